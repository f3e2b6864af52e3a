"""Algorithm 2 of the paper: skip updates while episodes are good, and keep the best policy."""

from __future__ import annotations

from collections import deque
from copy import deepcopy
from typing import Any

import torch

from qcompile.rl.rollout import FinishedEpisode

_RUNNING_EPISODES = 20


class Pause:
    """Decides when to skip updates, and stores the model at the end of the longest good streak.

    An episode is good with at least `reward`; None never pauses. Source: arXiv 2203.14348.
    """

    def __init__(self, reward: float | None):
        self._reward = reward
        self._running: deque[float] = deque(maxlen=_RUNNING_EPISODES)
        self._row = self._longest = 0
        self.best: dict[str, torch.Tensor] | None = None

    def skips(self, finished: list[FinishedEpisode], actor: torch.nn.Module) -> bool:
        """Whether to skip the update after these episodes."""
        if self._reward is None:
            return False
        good = False
        for episode in finished:
            self._running.append(episode.reward)
            good = episode.reward >= self._reward
            if good:
                self._row += 1
                if self._row > self._longest:
                    self._longest, self.best = self._row, deepcopy(actor.state_dict())
        if sum(self._running) < self._reward * len(self._running):
            self._row = 0
        return good or self._row > 0

    def state(self) -> dict[str, Any]:
        """The state for `restore`."""
        return {
            "running": list(self._running),
            "row": self._row,
            "longest": self._longest,
            "best": self.best,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`."""
        self._running.clear()
        self._running.extend(state["running"])
        self._row, self._longest, self.best = state["row"], state["longest"], state["best"]
