"""Whether a twin still shows what its machine does: fresh counts of a policy's circuits.

Source: the chi-square test of residuals with a known covariance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.lockstep import Act
from qcompile.deploy.play import Record, play
from qcompile.deploy.rows import Rows
from qcompile.deploy.twin_power import EFFECT, TwinShown, twin_program
from qcompile.errors import CalibrationError
from qcompile.execution import Executor, TwinExecutor, expectation_from_ones
from qcompile.mitigation import Misfit, misfits
from qcompile.mitigation.drift import contradicted
from qcompile.policy import Policy

_NO_THETA = np.zeros(0)
_EPISODES = 4
_STEPS = 500
_MOST_SEEN = 200
_STRETCHES = (1, 3, 10, 30)


@dataclass(frozen=True, eq=False)
class TwinCheck:
    """Chi-square of each qubit's fresh `<Z>` against the twin's, with its p-value.

    `qubits`, `chi_square` and `p_value` are (qubits,), `degrees` (qubits,) the numbers of `<Z>`;
    `failed` are the qubits that are `contradicted`. `largest` is the largest difference of a
    `<Z>`, in units of `<Z>`. `power` (qubits,) is how often a p01 of that qubit is found that is
    raised by `effect`; `misfits` are the curves that contradict the counts they were fitted to.
    """

    qubits: IntArray
    chi_square: FloatArray
    degrees: IntArray
    p_value: FloatArray
    largest: float
    observations: int
    effect: float
    power: FloatArray
    misfits: list[Misfit]

    @property
    def failed(self) -> list[int]:
        return contradicted(self.qubits, self.p_value)

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
            "observations": self.observations,
            "effect": self.effect,
            "power": self.power.tolist(),
            "least_power": float(self.power.min()),
            "calibration_misfits": [misfit.values() for misfit in self.misfits],
        }


def check_twin(
    calibration: Calibration,
    policy: Policy,
    observations: FloatArray,
    executor: Executor,
    shots: int,
    effect: float = EFFECT,
) -> TwinCheck:
    """Run the policy's circuits for observations (B, features) and compare with the twin.

    The residuals of a qubit have the covariance of shot noise and of its curve, which they share:
    r' C^-1 r is chi-square distributed where the twin is right. The power is stated for `effect`.

    Raises:
        CalibrationError: the executor is one of another device, or a circuit lies on no curve.
    """
    own = executor.device
    if (own.name, len(own.qubits)) != (calibration.backend, len(calibration.device.qubits)):
        raise CalibrationError(
            f"The calibration is of {calibration.backend}, the backend is {own.name}.",
            "Compare a twin with its own device.",
        )
    shown = TwinShown.of(calibration, policy, observations)
    _, executable = twin_program(calibration, policy)
    ones = executor.run(
        replace(executable, device=own), policy.encode(observations), _NO_THETA, shots
    )
    z = expectation_from_ones(ones, shots)
    variance = shown.variance(shots)
    chi_square, degrees = [], []
    for number, shared in enumerate(shown.covariance):
        on = shown.own == number
        residual = (z - shown.expected)[:, on].ravel()
        design = shown.design[:, on].reshape(-1, 3)
        covariance = design @ shared @ design.T + np.diag(variance[:, on].ravel())
        chi_square.append(residual @ np.linalg.solve(covariance, residual))
        degrees.append(residual.size)
    from scipy.stats import chi2

    found = np.array(chi_square)
    return TwinCheck(
        qubits=shown.qubits,
        chi_square=found,
        degrees=np.array(degrees),
        p_value=chi2.sf(found, degrees),
        largest=float(np.abs(z - shown.expected).max()),
        observations=len(observations),
        effect=effect,
        power=shown.powers(shots, effect)[-1],
        misfits=misfits(calibration, ["response"], shown.qubits.tolist()),
    )


def wide_observations(policy: Policy, calibration: Calibration, seed: int) -> FloatArray:
    """(rows, features): steps of episodes that the policy plays on the twin, and mixtures of them.

    A mixture takes every feature from another step, times one of _STRETCHES: so qubits show parts
    of their curves that they rarely show while the policy plays.
    """
    twin = TwinExecutor(calibration, seed)
    deployment = Deployment(policy, twin, shots=1024, predistort=True, seed=seed, max_steps=_STEPS)
    kept = _Kept()
    play(deployment, _EPISODES, record=kept)
    seen = np.concatenate(kept.observations)
    rng = np.random.default_rng(seed)
    seen = seen[rng.choice(len(seen), min(_MOST_SEEN, len(seen)), replace=False)]
    return np.concatenate([seen, *(times * rng.permuted(seen, axis=0) for times in _STRETCHES)])


class _Kept(Record):
    """Keeps the observations of a run."""

    def __init__(self) -> None:
        self.observations: list[FloatArray] = []

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        self.observations.append(observations.copy())
        return act(observations, rows)

    def rewards(self, rewards: list[float]) -> None:
        """They do not matter here."""
