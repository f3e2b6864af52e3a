"""Advantage estimates: pure functions of (steps, environments) arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from qcompile.arrays import BoolArray, FloatArray


def generalised_advantage(
    rewards: FloatArray,
    values: FloatArray,
    next_values: FloatArray,
    terminated: BoolArray,
    done: BoolArray,
    gamma: float,
    gae_lambda: float,
) -> FloatArray:
    """Generalised advantage estimates, (steps, environments) like all arguments.

    A_t = delta_t + gamma lambda A_(t+1), delta_t = r_t + gamma V(s_(t+1)) - V(s_t). V is 0 after a
    terminated step and nothing flows back over the end of an episode (`done`, terminated or
    truncated). With lambda = 1 it is the discounted return minus V(s_t). Source: arXiv 1506.02438.
    """
    deltas = rewards + gamma * next_values * ~terminated - values
    flow = gamma * gae_lambda * ~done
    advantages = np.zeros_like(rewards)
    following = np.zeros(rewards.shape[1])
    for step in reversed(range(len(rewards))):
        following = deltas[step] + flow[step] * following
        advantages[step] = following
    return advantages


class ReturnScale:
    """The running standard deviation of discounted returns, to divide rewards by."""

    def __init__(self, environments: int, gamma: float):
        self._gamma, self._running = gamma, np.zeros(environments)
        self._count, self._mean, self._m2 = 0.0, 0.0, 0.0

    def update(self, rewards: FloatArray, done: BoolArray) -> float:
        """The scale after these steps, (steps, environments) arrays; 1 until returns differ."""
        returns = np.empty_like(rewards)
        for step, reward in enumerate(rewards):
            self._running = self._gamma * self._running + reward
            returns[step] = self._running
            self._running = self._running * ~done[step]
        # Chan's parallel update of mean and variance.
        count, mean = returns.size, float(returns.mean())
        delta, total = mean - self._mean, self._count + count
        self._m2 += float(((returns - mean) ** 2).sum()) + delta**2 * self._count * count / total
        self._mean += delta * count / total
        self._count = total
        return max(float(np.sqrt(self._m2 / total)), 1e-6) if self._m2 > 0 else 1.0

    def state(self) -> dict[str, Any]:
        """The state for `restore`."""
        moments = [self._count, self._mean, self._m2]
        return {"running": self._running.tolist(), "moments": moments}

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`."""
        self._running = np.array(state["running"])
        self._count, self._mean, self._m2 = state["moments"]
