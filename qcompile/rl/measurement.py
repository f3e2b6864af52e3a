"""From inputs to the <Z> that a device shows: compiled once, run, mitigated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qcompile.device import Device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor, check_shots, expectation_from_ones
from qcompile.ir import Program
from qcompile.mitigation import CALIBRATION_SHOTS, ReadoutMitigation, calibrate_readout
from qcompile.passes import Executable, compile

FloatArray = NDArray[np.float64]

MITIGATIONS = ("none", "readout")


class Measurement:
    """A program compiled for a device, with its executor and its mitigation.

    `shots` None takes expectations without shot noise. Shot noise and the calibration draw from
    `seed`, so a measurement repeats exactly. `importance` (circuits,) guides the placement. With
    `copies` so many rows of a batch are run side by side, by one execution.

    Raises:
        CalibrationError: `mitigation` is not one of MITIGATIONS, or a qubit cannot be calibrated.
        CircuitError: importance or copies are out of range.
        CountsError: shots out of range.
    """

    def __init__(
        self,
        program: Program,
        device: Device,
        *,
        shots: int | None,
        level: int = 2,
        mitigation: str = "none",
        seed: int | np.random.SeedSequence = 0,
        importance: FloatArray | None = None,
        copies: int = 1,
    ):
        if shots is not None:
            check_shots(shots)
        if mitigation not in MITIGATIONS:
            raise CalibrationError(
                f"Unknown mitigation {mitigation!r}.", f"Known: {', '.join(MITIGATIONS)}."
            )
        self.shots, self.copies = shots, copies
        self.executor = OfflineExecutor(device, seed)
        self.executable: Executable = compile(program, device, level, importance, copies=copies)
        # The tables of binding and noise are built by the first use; not in the first step, then.
        nothing = np.zeros((0, copies * len(program.inputs)))
        self.executor.expectation(self.executable, nothing, np.zeros(len(program.parameters)))
        self._readout: ReadoutMitigation | None = None
        if mitigation == "readout":
            qubits = self.executable.qubits
            calibration = None if shots is None else CALIBRATION_SHOTS
            self._readout = calibrate_readout(self.executor, qubits, calibration).at(qubits)

    def __call__(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """Inputs (B, inputs) and theta (parameters,) to <Z> as measured, (B, circuits)."""
        rows, copies = len(x), self.copies
        if copies > 1:  # side by side; the last row is filled up with zeros
            x = np.pad(x, ((0, -rows % copies), (0, 0)))
            x = x.reshape(len(x) // copies, copies * x.shape[1])
        if self.shots is None:
            z = self.executor.expectation(self.executable, x, theta)
        else:
            ones = self.executor.run(self.executable, x, theta, self.shots)
            z = expectation_from_ones(ones, self.shots)
        if self._readout is not None:
            z = self._readout.apply(z)
        return z.reshape(len(z) * copies, z.shape[1] // copies)[:rows]
