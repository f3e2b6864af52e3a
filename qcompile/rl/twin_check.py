"""Whether a twin still shows what its machine does: fresh counts of a policy's circuits.

Source: the chi-square test of residuals with a known covariance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.execution import Executor, TwinExecutor, expectation_from_ones
from qcompile.mitigation.drift import DRIFT_LEVEL
from qcompile.passes import Executable, compile
from qcompile.policy import Policy
from qcompile.rl.evaluate import Deployment, Record, play
from qcompile.rl.lockstep import Act

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
_NO_THETA = np.zeros(0)
_EPISODES = 4
_STEPS = 500


@dataclass(frozen=True, eq=False)
class TwinCheck:
    """Chi-square of each qubit's fresh <Z> against the twin's, with its p-value.

    `qubits`, `chi_square` and `p_value` are (qubits,), `degrees` (qubits,) the numbers of <Z>;
    `failed` are the qubits whose p-value lies below DRIFT_LEVEL divided by their number
    (Bonferroni). `largest` is the largest difference of a <Z>, in units of <Z>.
    """

    qubits: IntArray
    chi_square: FloatArray
    degrees: IntArray
    p_value: FloatArray
    largest: float

    @property
    def failed(self) -> list[int]:
        level = DRIFT_LEVEL / len(self.qubits)
        return [int(q) for q in self.qubits[self.p_value < level]]

    def values(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "passed": not self.failed,
            "failed": self.failed,
            "qubits": self.qubits.tolist(),
            "chi_square": self.chi_square.tolist(),
            "degrees": self.degrees.tolist(),
            "p_value": self.p_value.tolist(),
            "largest_difference": self.largest,
        }


def twin_program(calibration: Calibration, policy: Policy) -> tuple[TwinExecutor, Executable]:
    """The twin, and the policy compiled for it at level 2.

    Raises:
        CalibrationError: the calibration has no curves, or not enough qubits.
    """
    twin = TwinExecutor(calibration)
    return twin, compile(policy.trained_program, twin.device, 2, policy.importance)


def check_twin(
    calibration: Calibration,
    policy: Policy,
    observations: FloatArray,
    executor: Executor,
    shots: int,
) -> TwinCheck:
    """Run the policy's circuits for observations (B, features) and compare with the twin.

    The residuals of a qubit have the covariance of shot noise and of its curve, which they share:
    r' C^-1 r is chi-square distributed where the twin is right.

    Raises:
        CalibrationError: the executor is one of another device, or a circuit lies on no curve.
    """
    own = executor.device
    if (own.name, len(own.qubits)) != (calibration.backend, len(calibration.device.qubits)):
        raise CalibrationError(
            f"The calibration is of {calibration.backend}, the backend is {own.name}.",
            "Compare a twin with its own device.",
        )
    fit = calibration.response
    twin, executable = twin_program(calibration, policy)
    assert fit is not None  # the twin has curves
    x = policy.encode(observations)
    angles = executable.bind(x, _NO_THETA)
    _check_curves(executable)
    expected = twin.expectation(executable, x, _NO_THETA)
    ones = executor.run(replace(executable, device=own), x, _NO_THETA, shots)
    z = expectation_from_ones(ones, shots)
    variance = np.maximum(1.0 - expected**2, 1.0 / shots) / shots
    qubits = np.unique(executable.qubits)
    rows = calibration.rows(qubits)
    chi_square, degrees = [], []
    for qubit, row in zip(qubits, rows, strict=True):
        on = executable.qubits == qubit
        residual = (z - expected)[:, on].ravel()
        turns = angles[:, on].ravel()
        design = np.stack([np.ones_like(turns), np.cos(turns), np.sin(turns)], axis=1)
        shared = design @ np.array(fit.covariance[row]) @ design.T
        covariance = shared + np.diag(variance[:, on].ravel())
        chi_square.append(residual @ np.linalg.solve(covariance, residual))
        degrees.append(residual.size)
    from scipy.stats import chi2

    found = np.array(chi_square)
    p_value = chi2.sf(found, degrees)
    return TwinCheck(qubits, found, np.array(degrees), p_value, float(np.abs(z - expected).max()))


def _check_curves(executable: Executable) -> None:
    for index, gates in enumerate(executable.gate_counts()):
        if not (gates["rz"] or gates["rx"]):
            raise CalibrationError(
                f"Circuit {index} has no rotation: it lies on no curve.",
                "Validate with another policy.",
            )


def random_observations(
    policy: Policy, calibration: Calibration, rows: int, seed: int
) -> FloatArray:
    """(rows, features): drawn from the steps of episodes that the policy plays on the twin."""
    deployment = Deployment(
        policy, TwinExecutor(calibration, seed), shots=1024, mitigation="response", seed=seed
    )
    kept = _Kept()
    play(deployment, _EPISODES, max_steps=_STEPS, record=kept)
    seen = np.concatenate(kept.observations)
    rng = np.random.default_rng(seed)
    return seen[rng.choice(len(seen), rows, replace=len(seen) < rows)]


class _Kept(Record):
    """Keeps the observations of a run."""

    def __init__(self) -> None:
        self.observations: list[FloatArray] = []

    def act(self, act: Act, observations: FloatArray) -> IntArray:
        self.observations.append(observations.copy())
        return act(observations)

    def rewards(self, rewards: list[float]) -> None:
        """They do not matter here."""
