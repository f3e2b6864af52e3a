"""The executor that plays a device's measured response curves: its twin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from qcompile.arrays import CountArray, FloatArray, IntArray
from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.errors import CalibrationError
from qcompile.execution.executor import Kind, check_device, check_shots
from qcompile.passes import Executable


@dataclass(frozen=True, eq=False)
class _Table:
    """b, c, s (3, circuits); the angle and the `<Z>` of circuits that have them fixed, else nan."""

    curves: FloatArray
    fixed_rad: FloatArray
    shown: FloatArray


class TwinExecutor:
    """Runs executables of level 2 on the response curves of a calibration.

    The measured `<Z>` of sx rz(a) sx, or rx(a), is b + c cos(a) + s sin(a). The empty circuit and x
    show what the readout was calibrated with; sx alone, and those two where no readout was
    calibrated, are taken to lie on the curve. A twin is no hardware: it has the noise that was
    measured, not what comes since. The same seed and the same calls give the same counts.

    Raises:
        CalibrationError: the calibration holds no response curves.
    """

    kind: Kind = "measured-response"

    def __init__(self, calibration: Calibration, seed: int | np.random.SeedSequence | None = None):
        if calibration.response is None:
            raise CalibrationError(
                f"The calibration of {calibration.backend} holds no response curves.",
                *calibration.unfitted,
                "`qcompile calibrate` measures them; without them there is nothing to play.",
            )
        self.calibration, self._curves = calibration, np.array(calibration.response.curves)
        left_out = set(range(len(calibration.device.qubits))) - set(calibration.qubits)
        left_out |= set(calibration.device.left_out)
        # Not `model_copy`: it would bring what is cached of the qubits that are usable.
        fields = calibration.device.model_dump() | {"left_out": tuple(sorted(left_out))}
        self.device = Device(**fields)
        self.rng = np.random.default_rng(seed)
        self._tables: WeakKeyDictionary[Executable, _Table] = WeakKeyDictionary()

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The number of ones of each circuit in `shots` shots, (B, circuits) integers.

        Raises:
            CalibrationError: another level than 2, or a qubit without a curve.
            CountsError: shots out of range.
            DeviceError: the executable was compiled for another device.
        """
        check_shots(shots)
        p_one = (1.0 - self.expectation(executable, x, theta)) / 2.0
        return self.rng.binomial(shots, np.clip(p_one, 0.0, 1.0))

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured `<Z>` of each circuit without shot noise, (B, circuits), readout included.

        Raises:
            CalibrationError: another level than 2, or a qubit without a curve.
            DeviceError: the executable was compiled for another device.
        """
        table = self._tables.get(executable)
        if table is None:
            table = self._tables[executable] = self._table(executable)
        angles = executable.bind_slots(x, theta)[..., 0]
        angles = np.where(np.isnan(table.fixed_rad), angles, table.fixed_rad)
        b, c, s = table.curves
        z = b + c * np.cos(angles) + s * np.sin(angles)
        return np.where(np.isnan(table.shown), z, table.shown)

    def _table(self, executable: Executable) -> _Table:
        check_device(executable, self.device)
        rows = self.calibration.rows(executable.qubits)
        gates = [" ".join(gate.name for gate in made.gates) for made in executable.native.circuits]
        polar = np.array([_polar_of_fixed(names) for names in gates])
        fixed_rad = executable.angle_offset_rad + polar
        return _Table(self._curves[rows].T, fixed_rad, self._shown(gates, rows))

    def _shown(self, gates: list[str], rows: IntArray) -> FloatArray:
        """(circuits,): the `<Z>` of the circuits that the readout was calibrated with, else nan."""
        shown = np.full(len(gates), math.nan)
        fit = self.calibration.readout
        if fit is not None:
            of_zero, of_one = 1.0 - 2.0 * np.array(fit.p10)[rows], 2.0 * np.array(fit.p01)[rows] - 1
            shown = np.where([names == "" for names in gates], of_zero, shown)
            shown = np.where([names == "x" for names in gates], of_one, shown)
        return np.asarray(shown)


def _polar_of_fixed(gates: str) -> float:
    """The polar angle that `gates` without a rotation make of |0>; nan if they have one."""
    polar = {"": 0.0, "sx": math.pi / 2, "x": math.pi, "sx rz sx": math.nan, "rx": math.nan}
    if gates not in polar:
        raise CalibrationError(
            f"A measured response knows sx rz sx, found {gates!r}.", "Use level 2."
        )
    return polar[gates]
