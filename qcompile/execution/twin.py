"""The twin executor, which simulates a device by its measured response curves."""

from __future__ import annotations

import math

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.device import Device, Kind
from qcompile.errors import CalibrationError
from qcompile.execution.executor import Executor, check_device
from qcompile.execution.prepared import ExactPrepared
from qcompile.ir import Circuit
from qcompile.native import NativeGates
from qcompile.passes import Executable


class TwinExecutor(Executor):
    """Runs executables of level 2 on the response curves of a calibration.

    The measured `<Z>` of sx rz(a) sx, or rx(a), is b + c cos(a) + s sin(a). The empty circuit and x
    show the calibrated readout; sx alone, and those two if no readout was calibrated, are assumed
    to lie on the curve. A twin is not hardware: it has the noise at the time of the calibration,
    not later changes. The same seed and the same calls give the same counts.

    Raises:
        CalibrationError: the calibration has no response curves.
    """

    kind: Kind = "measured-response"

    def __init__(self, calibration: Calibration, seed: int | np.random.SeedSequence | None = None):
        if calibration.response is None:
            raise CalibrationError(
                f"The calibration of {calibration.backend} has no response curves.",
                *calibration.unfitted,
                "A twin needs them: measure them with `qcompile calibrate`.",
            )
        self.calibration: Calibration = calibration
        left_out = set(range(len(calibration.device.qubits))) - set(calibration.qubits)
        left_out |= set(calibration.device.left_out)
        fields = calibration.device.model_dump() | {"left_out": tuple(sorted(left_out))}
        self.device = Device(**fields)
        self.rng = np.random.default_rng(seed)

    def prepare(self, executable: Executable) -> ExactPrepared:
        """The executable with the response curves of its qubits.

        Raises:
            CalibrationError: the level is not 2, or a qubit has no curve.
            CircuitError: a circuit has several qubits, or other observables than its own.
            DeviceError: the executable was compiled for another device.
        """
        check_device(executable, self.device)
        return _PreparedTwin(executable, self.calibration, self.rng)


class _PreparedTwin(ExactPrepared):
    def __init__(self, executable: Executable, calibration: Calibration, rng: np.random.Generator):
        super().__init__(executable, rng)
        executable.source.require_narrow(
            "A twin", "Use the noise model of the device, or the machine."
        )
        assert calibration.response is not None  # the twin has curves
        rows = calibration.rows(executable.qubits)
        native = executable.device.native
        polar = np.array([_polar_rad(circuit, native) for circuit in executable.native.circuits])
        self._curves = np.array(calibration.response.curves)[rows].T
        self._fixed_rad = native.angle_offset_rad + polar
        self._shown = np.full(len(polar), math.nan)
        if calibration.readout is not None:
            p10, p01 = (
                np.array(p)[rows] for p in (calibration.readout.p10, calibration.readout.p01)
            )
            self._shown = np.where(polar == 0.0, 1.0 - 2.0 * p10, self._shown)
            self._shown = np.where(polar == math.pi, 2.0 * p01 - 1, self._shown)

    def expectation(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        angles = self.executable.bind(x, theta)
        angles = np.where(np.isnan(self._fixed_rad), angles, self._fixed_rad)
        b, c, s = self._curves
        z = b + c * np.cos(angles) + s * np.sin(angles)
        return np.where(np.isnan(self._shown), z, self._shown)

    def p_one(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        return (1.0 - self.expectation(x, theta)) / 2.0


def _polar_rad(circuit: Circuit, native: NativeGates) -> float:
    """The polar angle of the state of a circuit without a rotation; nan for one with a rotation."""
    polar_rad = native.polar_angle_rad(circuit)
    if polar_rad is None:
        gates = " ".join(gate.name for gate in circuit.gates)
        raise CalibrationError(f"A twin runs sx rz sx, found {gates!r}.", "Use level 2.")
    return polar_rad
