"""Readout mitigation: an assignment matrix for each physical qubit, undone in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qcompile.device import Device
from qcompile.errors import CalibrationError
from qcompile.execution.executor import Executor
from qcompile.ir import Circuit, Gate, Program
from qcompile.passes import Executable, compile

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

CALIBRATION_SHOTS = 8192
_LEAST_CONTRAST = 0.02


@dataclass(frozen=True, eq=False)
class ReadoutMitigation:
    """Assignment matrices A[qubit, measured, prepared] of the qubits in `qubits`, (n, 2, 2)."""

    qubits: IntArray
    assignment: FloatArray

    def at(self, qubits: IntArray) -> ReadoutMitigation:
        """The mitigation of circuits on `qubits` (circuits,), one matrix for each circuit.

        Raises:
            CalibrationError: a qubit was not calibrated.
        """
        missing = np.setdiff1d(qubits, self.qubits)
        if missing.size:
            raise CalibrationError(
                f"Qubit {missing[0]} has no calibration.",
                f"Calibrated: {' '.join(map(str, self.qubits))}.",
            )
        order = np.argsort(self.qubits)
        rows = order[np.searchsorted(self.qubits, qubits, sorter=order)]
        return ReadoutMitigation(qubits, self.assignment[rows])

    @cached_property
    def _line(self) -> tuple[FloatArray, FloatArray]:
        p10, p01 = self.assignment[:, 1, 0], self.assignment[:, 0, 1]
        return p01 - p10, 1.0 - p01 - p10

    def apply(self, z: FloatArray) -> FloatArray:
        """<Z> before the readout, for measured z (B, n) on `qubits`.

        Measured <Z> is b + c <Z> with b = p01 - p10 and c = 1 - p01 - p10; this is its inverse,
        clipped to [-1, 1], which is the least-squares solution under that constraint.
        """
        offset, contrast = self._line
        return np.minimum(np.maximum((z - offset) / contrast, -1.0), 1.0)


def calibrate_readout(
    executor: Executor, qubits: IntArray, shots: int | None = CALIBRATION_SHOTS
) -> ReadoutMitigation:
    """Prepare and measure |0> and |1> on each of `qubits`, two executions of `shots`, and fit.

    Without shots the exact probabilities are fitted. The noise of the gate that prepares |1>
    counts as readout error.

    Raises:
        CalibrationError: a qubit tells |0> and |1> apart too little to be undone.
    """
    qubits = np.unique(qubits)
    nothing = np.zeros((1, 0)), np.zeros(0)
    p_one = []
    for bit in (0, 1):
        prepared = _prepare(bit, qubits, executor.device)
        if shots is None:
            p_one.append((1.0 - executor.expectation(prepared, *nothing)[0]) / 2.0)
        else:
            p_one.append(executor.run(prepared, *nothing, shots)[0] / shots)
    return ReadoutMitigation(qubits, fit_assignment(p_one[0], p_one[1], qubits))


def fit_assignment(p_one_of_0: FloatArray, p_one_of_1: FloatArray, qubits: IntArray) -> FloatArray:
    """Assignment matrices (n, 2, 2) nearest to what was measured whose columns are distributions.

    `p_one_of_0` and `p_one_of_1` (n,) are the fractions of ones after |0> and |1> were prepared.
    """
    import cvxpy

    p_one = np.stack([p_one_of_0, p_one_of_1], axis=1)
    measured_1 = cvxpy.Variable((len(qubits), 2))  # P(1 | prepared)
    problem = cvxpy.Problem(
        cvxpy.Minimize(cvxpy.sum_squares(measured_1 - p_one)), [measured_1 >= 0, measured_1 <= 1]
    )
    # At the default 1e-8 an entry at 0 or 1 is off by 4e-5: it goes with the root of the gap.
    tolerance = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-12)
    problem.solve(solver=cvxpy.CLARABEL, **tolerance)
    if measured_1.value is None:
        raise CalibrationError(f"The fit ended with status {problem.status!r}.")
    fitted = np.clip(measured_1.value, 0.0, 1.0)
    weak = np.abs(fitted[:, 1] - fitted[:, 0]) < _LEAST_CONTRAST
    if weak.any():
        raise CalibrationError(
            f"Qubit {qubits[weak][0]} tells |0> and |1> apart by less than {_LEAST_CONTRAST}.",
            f"Found P(1|0) = {fitted[weak][0, 0]:.3f} and P(1|1) = {fitted[weak][0, 1]:.3f}.",
            "Leave the qubit out, or run with --mitigation none.",
        )
    return np.stack([1.0 - fitted, fitted], axis=1)


def _prepare(bit: int, qubits: IntArray, device: Device) -> Executable:
    """|bit> on every one of `qubits`, in the device's own gates."""
    circuit = Circuit((Gate("x"),)) if bit else Circuit()
    prepared = compile(Program((circuit,) * len(qubits)), device, level=1)
    return replace(prepared, qubits=qubits, rounds=np.zeros_like(qubits))
