"""The executor that plays a device's measured response curves: its twin."""

from __future__ import annotations

import math

import numpy as np

from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.execution.executor import CountArray, FloatArray, Kind, check_shots
from qcompile.passes import Executable


class TwinExecutor:
    """Runs executables of level 2 on the response curves of a calibration.

    The measured <Z> of sx rz(a) sx is b + c cos(a) + s sin(a); circuits without a rotation lie on
    the same curve. A twin is no hardware: it has the noise that was measured, not what comes since.
    The same seed and the same calls give the same counts.

    Raises:
        CalibrationError: the calibration holds no response curves.
    """

    kind: Kind = "measured-response"

    def __init__(self, calibration: Calibration, seed: int | np.random.SeedSequence | None = None):
        if calibration.response is None:
            raise CalibrationError(
                f"The calibration of {calibration.backend} holds no response curves.",
                "`qcompile calibrate` measures them; without them there is nothing to play.",
            )
        self.calibration, self._curves = calibration, np.array(calibration.response.curves)
        left_out = set(range(len(calibration.device.qubits))) - set(calibration.qubits)
        self.device = calibration.device.model_copy(
            update={"left_out": tuple(sorted(left_out | set(calibration.device.left_out)))}
        )
        self.rng = np.random.default_rng(seed)

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The number of ones of each circuit in `shots` shots, (B, circuits) integers.

        Raises:
            CalibrationError: another level than 2, or a qubit without a curve.
            CountsError: shots out of range.
        """
        check_shots(shots)
        p_one = (1.0 - self.expectation(executable, x, theta)) / 2.0
        return self.rng.binomial(shots, np.clip(p_one, 0.0, 1.0))

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured <Z> of each circuit without shot noise, (B, circuits), readout included.

        Raises:
            CalibrationError: another level than 2, or a qubit without a curve.
        """
        angles = self._angles(executable, x, theta)
        b, c, s = self._curves[self.calibration.rows(executable.qubits)].T
        return np.asarray(b + c * np.cos(angles) + s * np.sin(angles))

    def _angles(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """(B, circuits): the angle on the curve, where circuits without a rotation have theirs."""
        angles, offset = executable.bind_slots(x, theta)[..., 0], executable.angle_offset_rad
        at = [_polar_of_fixed(names, offset) for names in _gate_names(executable)]
        fixed = np.array([math.nan if a is None else a for a in at])
        return np.where(np.isnan(fixed), angles, fixed)


def _gate_names(executable: Executable) -> list[str]:
    return [" ".join(gate.name for gate in c.gates) for c in executable.native.circuits]


def _polar_of_fixed(gates: str, offset: float) -> float | None:
    """The native angle that does what `gates` without a rotation do; None if they have one."""
    polar = {"": 0.0, "sx": math.pi / 2, "x": math.pi}
    if gates in ("sx rz sx", "rx"):
        return None
    if gates not in polar:
        raise CalibrationError(
            f"A measured response knows sx rz sx, found {gates!r}.", "Use level 2."
        )
    return offset + polar[gates]
