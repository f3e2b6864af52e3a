"""Episodes played to their end on a model of the machine, and their reference rewards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import BoolArray, FloatArray, IntArray
from qcompile.deploy.completion import MOST_STEPS
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import close_environments, policy_environments
from qcompile.deploy.lockstep import Act, lockstep
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.result import Run
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.deploy.stepping import Stepper
from qcompile.device import Device
from qcompile.errors import OptionError
from qcompile.execution import Backend, Executor, Workload
from qcompile.planning.chains import Chains
from qcompile.policy import Policy
from qcompile.streams import Draws

RANDOM_EPISODES = 100


@dataclass(frozen=True, eq=False)
class Simulated:
    """Episodes played to their end: rewards and steps (episodes,), and chains.

    `settings` are resolved for `device`; `rounds` belong to the executable; `calibration` is the
    load of the initial calibration.
    """

    device: Device
    settings: RunSettings
    rewards: FloatArray
    steps: IntArray
    chains: Chains
    rounds: int
    calibration: Workload


class _Agreement(Recorder):
    """Records for every decision whether the predicted action was measured."""

    def __init__(self, predict: Act):
        self._predict = predict
        self._noted: list[tuple[Rows, BoolArray]] = []

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        actions = act(observations, rows)
        self._noted.append((rows, actions == self._predict(observations, rows)))
        return actions

    def rewards(self, rewards: list[float]) -> None:
        """Ignored: the episodes have them."""

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
    """Play `episodes` episodes of the policy on the backend, each to its end.

    A job measures one decision of each episode, whatever the settings say about speculation and
    cuts.

    Raises:
        OptionError: an episode does not end. QcompileError: as for `Deployment` and `play`.
    """
    deployment = Deployment(policy, backend, settings, speculate=1, max_steps=MOST_STEPS)
    agreement = _Agreement(deployment.predict)
    run = _whole(play(deployment, episodes, recorder=agreement))
    shots = deployment.calibration_shots
    counted = {} if shots is None else {"calibration_shots": shots}
    return Simulated(
        deployment.device,
        RunSettings.of(deployment.settings, max_steps=None, **counted),
        run.rewards,
        np.array([episode.length for episode in run.episodes]),
        agreement.chains(episodes),
        deployment.executable.round_count,
        deployment.calibration_load,
    )


def ideal_rewards(policy: Policy, settings: RunSettings, episodes: int) -> FloatArray:
    """The policy's rewards with exact `<Z>` without noise, from the resets of the settings."""
    exact = RunSettings(
        shots=None, seed=settings.seed, greedy=settings.greedy, max_steps=MOST_STEPS
    )
    return _whole(play(Deployment(policy, "ideal", exact), episodes)).rewards


def _whole(run: Run) -> Run:
    """The run, checked to have only whole episodes.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed. OptionError: an episode does not end.
    """
    if run.interrupted:
        raise KeyboardInterrupt
    if run.cut_episodes:
        raise _endless(run.player.policy.environment)
    return run


def _endless(environment: str) -> OptionError:
    return OptionError(
        f"An episode of {environment} did not end within {MOST_STEPS:,} environment steps.",
        "Settings are evaluated with whole episodes. Register the environment with "
        "max_episode_steps, or choose shots yourself.",
    )


def random_rewards(policy: Policy, seed: int) -> FloatArray:
    """Rewards of 100 episodes with random actions in the policy's environment, same resets.

    A new action is drawn uniformly at every step of the environment.

    Raises:
        OptionError: an episode does not end.
    """
    draws, actions = Draws(seed, 0), policy.actions
    steppers: list[Stepper] = []

    def act(observations: FloatArray, rows: Rows) -> IntArray:
        return np.asarray(draws.actions(rows.episode, rows.decision) * actions).astype(np.intp)

    environments = policy_environments(policy, RANDOM_EPISODES)
    try:
        lockstep(act, environments, seed, max_steps=MOST_STEPS, on_begin=steppers.extend)
    finally:
        close_environments(environments)
    if any(stepper.is_cut for stepper in steppers):
        raise _endless(policy.environment)
    return np.array([stepper.reward for stepper in steppers])
