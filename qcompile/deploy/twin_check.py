"""Checks whether a twin still matches its machine, with fresh counts of a policy's circuits.

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
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.rows import Rows
from qcompile.deploy.twin_power import EFFECT, TwinPrediction, twin_program
from qcompile.errors import CalibrationError
from qcompile.execution import Executor, TwinExecutor, expectation_from_ones
from qcompile.mitigation import Misfit, misfits
from qcompile.mitigation.drift import contradicted
from qcompile.policy import Policy
from qcompile.policy.policy import NO_THETA

_EPISODES = 4
_STEPS = 500
_MAX_PLAYED = 200
_STRETCHES = (1, 3, 10, 30)


@dataclass(frozen=True, eq=False)
class TwinCheck:
    """Chi-square of each qubit's fresh `<Z>` against the twin's, with its p-value.

    `qubits`, `chi_square` and `p_value` are (qubits,); `degrees` (qubits,) are the numbers of `<Z>`
    values; `failed` are the qubits that are `contradicted`. `largest` is the largest difference in
    `<Z>`. `power` (qubits,) is the probability of detecting a p01 of that qubit raised by `effect`;
    `misfits` are the curves that contradict the counts they were fitted to.
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
        """The check as plain values."""
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

    The residuals of a qubit have the covariance of shot noise plus that of their common curve: r'
    C^-1 r is chi-square distributed if the twin is right. The power refers to `effect`.

    Raises:
        CalibrationError: the executor has another device, or a circuit has no response curve.
    """
    from scipy.stats import chi2

    device = executor.device
    if (device.name, len(device.qubits)) != (calibration.backend, len(calibration.device.qubits)):
        raise CalibrationError(
            f"The calibration belongs to {calibration.backend}; the backend is {device.name}.",
            "Compare a twin with its own device.",
        )
    prediction = TwinPrediction.of(calibration, policy, observations)
    _, executable = twin_program(calibration, policy)
    executable = replace(executable, device=device)
    ones = executor.run(executable, policy.encode(observations), NO_THETA, shots)
    residuals = expectation_from_ones(ones, shots) - prediction.expected
    chi_square = _chi_square(prediction, residuals, prediction.variance(shots))
    degrees = len(observations) * np.bincount(prediction.qubit_of)
    return TwinCheck(
        qubits=prediction.qubits,
        chi_square=chi_square,
        degrees=degrees,
        p_value=chi2.sf(chi_square, degrees),
        largest=float(np.abs(residuals).max()),
        observations=len(observations),
        effect=effect,
        power=prediction.powers(shots, effect)[-1],
        misfits=misfits(calibration, ["response"], prediction.qubits.tolist()),
    )


def _chi_square(
    prediction: TwinPrediction, residuals: FloatArray, variance: FloatArray
) -> FloatArray:
    """r' C^-1 r of each qubit, (qubits,), for residuals and shot noise (rows, circuits)."""
    chi_square = []
    for qubit, of_curve in enumerate(prediction.covariance):
        on = prediction.qubit_of == qubit
        residual, design = residuals[:, on].ravel(), prediction.design[:, on].reshape(-1, 3)
        covariance = design @ of_curve @ design.T + np.diag(variance[:, on].ravel())
        chi_square.append(residual @ np.linalg.solve(covariance, residual))
    return np.array(chi_square)


def wide_observations(policy: Policy, calibration: Calibration, seed: int) -> FloatArray:
    """Observations (rows, features) of episodes on the twin, and mixtures of them.

    A mixture takes every feature from another step, times one of _STRETCHES. So qubits cover parts
    of their curves that they rarely reach while the policy plays.
    """
    twin = TwinExecutor(calibration, seed)
    deployment = Deployment(policy, twin, shots=1024, predistort=True, seed=seed, max_steps=_STEPS)
    recorder = _Observations()
    play(deployment, _EPISODES, recorder=recorder)
    played = np.concatenate(recorder.observations)
    rng = np.random.default_rng(seed)
    played = played[rng.choice(len(played), min(_MAX_PLAYED, len(played)), replace=False)]
    mixtures = [factor * rng.permuted(played, axis=0) for factor in _STRETCHES]
    return np.concatenate([played, *mixtures])


class _Observations(Recorder):
    """Records only the observations of a run."""

    def __init__(self) -> None:
        self.observations: list[FloatArray] = []

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        self.observations.append(observations.copy())
        return act(observations, rows)

    def rewards(self, rewards: list[float]) -> None:
        """Ignored: only observations are recorded."""
