"""An environment whose law is known in closed form, and loops that break it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from fresh import FreshExecutor
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray
from scipy import stats

from qcompile.device import load_device
from qcompile.execution import OfflineExecutor, Prepared
from qcompile.passes import Executable
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel

STEPS, MISSES, SHOTS = 24, 6, 3


class Coins(gymnasium.Env[Any, Any]):
    """Pays 1 for action 1. Over after 24 steps, or after `misses` of action 0. Sees nothing new."""

    def __init__(self, misses: int = MISSES):
        self.observation_space, self.action_space = Box(0, 1, (1,), np.float32), Discrete(2)
        self.misses = misses

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.taken = np.zeros(2, int)
        return np.full(1, 0.5, np.float32), {}

    def step(self, action: Any) -> Any:
        self.taken[action] += 1
        is_over = self.taken.sum() == STEPS or self.taken[0] == self.misses
        return np.full(1, 0.5, np.float32), float(action), bool(is_over), False, {}


def coins(**arguments: int) -> Policy:
    """Decides by one circuit, so steeply that a shot more or less changes much."""
    program, _ = parallel(1, 1)
    return Policy(
        "coins",
        "Coins-v0",
        Encoder("arctan", np.array([0]), np.ones(1)),
        program,
        np.array([-0.9]),
        np.array([[-2.0], [2.0]]),
        np.zeros(2),
        environment_kwargs=arguments,
    )


def chance(device: str) -> float:
    """How probable action 1 is: by the binomial law of the counts, and the logistic function."""
    from qcompile.passes import compile

    policy, opened = coins(), load_device(device)
    executable = compile(policy.trained_program, opened)
    x = policy.encode(np.full((1, 1), 0.5))
    z = OfflineExecutor(opened).expectation(executable, x, np.zeros(0))[0, 0]
    ones = np.arange(SHOTS + 1)
    counts = stats.binom.pmf(ones, SHOTS, (1 - z) / 2)
    return float((counts / (1 + np.exp(-4 * (1 - 2 * ones / SHOTS)))).sum())


def law(of_one: float) -> NDArray[np.float64]:
    """The probability of each reward, 0 to 24, of an episode of `Coins`, from that of action 1."""
    rewards = np.arange(STEPS + 1)
    by_misses = stats.nbinom.pmf(rewards, MISSES, 1 - of_one)  # ones before the sixth zero
    to_the_end = stats.binom.pmf(rewards, STEPS, of_one)
    return np.where(rewards <= STEPS - MISSES, by_misses, to_the_end)


def surprise(rewards: NDArray[np.float64], probabilities: NDArray[np.float64]) -> float:
    """The p-value of a chi-square test of rewards against their law; rare ones count together."""
    count = len(rewards)
    observed = np.bincount(rewards.astype(int), minlength=len(probabilities))
    common = probabilities * count >= 5
    parts = [(of[common], of[~common].sum()) for of in (observed, probabilities * count)]
    (seen, others), (expected, rest) = parts
    if rest > 1:
        seen, expected = np.append(seen, others), np.append(expected, rest)
    return float(stats.chisquare(seen, expected * seen.sum() / expected.sum()).pvalue)


class Remembering(FreshExecutor):
    """Broken: what was measured once serves whenever its inputs come back."""

    def prepare(self, executable: Executable) -> Prepared:
        fresh = super().prepare(executable)
        known: dict[bytes, Any] = {}

        class Kept(Prepared):
            shots_only = fresh.shots_only

            def ones(self, x, theta, shots, rng=None):  # type: ignore[no-untyped-def]
                counts = fresh.ones(x, theta, shots)
                # the first of a batch may be new; what an earlier batch measured is not
                before = dict(known)
                for row, ones in zip(x, counts, strict=True):
                    known.setdefault(row.tobytes(), ones)
                return np.stack(
                    [before.get(row.tobytes(), ones) for row, ones in zip(x, counts, strict=True)]
                )

        return Kept(executable)


def measured_again(pair: Any, actions: Any, agreed: Any) -> int:
    """Broken `_Pair.accept`: an action that was not predicted does not count, but for the first."""
    from qcompile.deploy.ahead import _answer

    pair.rewards = []
    for k, row in enumerate(pair.rows):
        if k and not agreed[row]:
            break
        observation, reward, terminated, truncated = pair.played.step(actions[row])
        pair.observation = observation
        pair.actions.append(actions[row])
        pair.answers.append(_answer(observation, reward, terminated, truncated))
        pair.rewards.append(reward)
        pair.is_over = terminated or truncated
        if pair.is_over or not agreed[row]:
            break
    pair._walked = None
    return len(pair.rewards)
