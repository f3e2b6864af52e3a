"""Episodes played to their end on a model of the machine, and what they are judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import BoolArray, FloatArray, IntArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import close_environments, policy_environments
from qcompile.deploy.lockstep import Act, Episode, lockstep
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.execution import Backend, Executor, Workload
from qcompile.planning.chains import Chains
from qcompile.policy import Policy
from qcompile.streams import Draws

RANDOM_EPISODES = 100


@dataclass(frozen=True, eq=False)
class Simulated:
    """Episodes that were played to their end: rewards and steps (episodes,), and their chains.

    `settings` are resolved for `device`, `rounds` those of the executable, `calibration` what was
    measured first.
    """

    device: Device
    settings: RunSettings
    rewards: FloatArray
    steps: IntArray
    chains: Chains
    rounds: int
    calibration: Workload


class _Agreement(Recorder):
    """Notes of every decision whether the predicted action is the measured one."""

    def __init__(self, predict: Act):
        self._predict = predict
        self._noted: list[tuple[Rows, BoolArray]] = []

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        actions = act(observations, rows)
        self._noted.append((rows, actions == self._predict(observations, rows)))
        return actions

    def rewards(self, rewards: list[float]) -> None:
        """They are those of the episodes."""

    def chains(self, episodes: int) -> Chains:
        decisions = np.zeros(episodes, dtype=np.intp)
        agree = np.zeros((episodes, len(self._noted)), dtype=bool)
        for rows, same in self._noted:
            agree[rows.episode, rows.decision] = same
            decisions[rows.episode] += 1
        return Chains(agree, decisions)


def simulate(
    policy: Policy, backend: Backend | Executor, settings: RunSettings, episodes: int
) -> Simulated:
    """`episodes` of the policy played on the backend, each to its end.

    A job measures one decision of each, whatever the settings say of speculation and cuts.

    Raises:
        QcompileError: as `Deployment` and `play`.
    """
    deployment = Deployment(policy, backend, settings, speculate=1, max_steps=None)
    noted = _Agreement(deployment.predict)
    run = play(deployment, episodes, recorder=noted)
    if run.interrupted:
        raise KeyboardInterrupt
    shots = deployment.calibration_shots
    counted = {} if shots is None else {"calibration_shots": shots}
    return Simulated(
        deployment.device,
        RunSettings.of(deployment.settings, **counted),
        run.rewards,
        np.array([episode.length for episode in run.episodes]),
        noted.chains(episodes),
        deployment.executable.round_count,
        deployment.calibration_load,
    )


def ideal_rewards(policy: Policy, settings: RunSettings, episodes: int) -> FloatArray:
    """The rewards of the policy on exact `<Z>` without noise, from the resets of the settings."""
    exact = RunSettings(shots=None, seed=settings.seed, greedy=settings.greedy)
    run = play(Deployment(policy, "ideal", exact), episodes)
    if run.interrupted:
        raise KeyboardInterrupt
    return run.rewards


def random_rewards(policy: Policy, seed: int) -> FloatArray:
    """The rewards of 100 episodes of random actions in the policy's environment, same resets.

    A new action is drawn at every step of the environment, each as likely as the others.
    """
    draws, actions = Draws(seed, 0), policy.actions
    finished: list[Episode] = []

    def act(observations: FloatArray, rows: Rows) -> IntArray:
        return np.asarray(draws.actions(rows.episode, rows.decision) * actions).astype(np.intp)

    environments = policy_environments(policy, RANDOM_EPISODES)
    try:
        lockstep(act, environments, seed, on_episode=finished.append)
    finally:
        close_environments(environments)
    return np.array([episode.reward for episode in finished])
