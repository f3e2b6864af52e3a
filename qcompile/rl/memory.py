"""The latest rollouts, from which an update learns together."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch

from qcompile.errors import TrainingError
from qcompile.rl.rollout import Collector, Rollout

_COLUMNS = {
    "actions": torch.int64,
    "rewards": torch.float64,
    "terminated": torch.bool,
    "truncated": torch.bool,
}
_ARRAYS = ("observations", "next_observations", *_COLUMNS)


class Memory:
    """Stores rollouts and their noise residuals for later updates.

    Steps of earlier rollouts are treated as if the current policy had taken them: it changes little
    in a few rollouts, and advantages are estimated again.
    """

    def __init__(self, rollouts: int):
        self._stored: deque[tuple[Rollout, list[torch.Tensor]]] = deque(maxlen=rollouts - 1)

    def joined(
        self, rollout: Rollout, residual: list[torch.Tensor]
    ) -> tuple[Rollout, list[torch.Tensor]]:
        """The stored rollouts followed by this one, joined, and their residuals.

        `residual` is empty or has one tensor (steps * environments, observables).
        """
        parts = [*self._stored, (rollout, residual)]
        self._stored.append((rollout, residual))
        if len(parts) == 1:
            return rollout, residual
        rollouts = [part for part, _ in parts]
        arrays = {name: np.concatenate([getattr(r, name) for r in rollouts]) for name in _ARRAYS}
        columns = zip(*(part for _, part in parts), strict=True)
        return Rollout(**arrays, finished=rollout.finished), [torch.cat(c) for c in columns]

    def state(self) -> list[dict[str, torch.Tensor]]:
        """The state for `restore`, a set of tensors for each rollout."""
        return [
            {name: torch.from_numpy(getattr(rollout, name)) for name in _ARRAYS}
            | dict(zip(["residual"], residual, strict=False))
            for rollout, residual in self._stored
        ]

    def restore(
        self,
        state: Sequence[Mapping[str, torch.Tensor]],
        collector: Collector,
        observables: int | None,
    ) -> None:
        """Resume from `state`, with residuals of `observables`, or None without noise.

        Raises:
            TrainingError: the state's rollouts do not belong to this training.
        """
        like, numbers = _empty(collector.observations, observables), set(range(collector.actions))
        if len(state) > (self._stored.maxlen or 0):
            raise TrainingError("The checkpoint has more rollouts than its settings allow.")
        self._stored.clear()
        for part in state:
            is_valid = _fits(part, like) and {*part["actions"].flatten().tolist()} <= numbers
            if not is_valid:
                raise TrainingError("A rollout in the checkpoint does not belong to its training.")
            arrays: dict[str, Any] = {name: part[name].numpy() for name in _ARRAYS}
            residual = [part["residual"]] if "residual" in part else []
            self._stored.append((Rollout(**arrays, finished=[]), residual))


def _empty(observations: np.ndarray[Any, Any], observables: int | None) -> dict[str, torch.Tensor]:
    """The tensors of an empty rollout."""
    empty = torch.from_numpy(observations[None][:0])
    like = {"observations": empty, "next_observations": empty}
    for name, dtype in _COLUMNS.items():
        like[name] = torch.empty(empty.shape[:2], dtype=dtype)
    if observables is not None:
        like["residual"] = torch.empty(0, observables)
    return like


def _fits(part: Mapping[str, torch.Tensor], like: Mapping[str, torch.Tensor]) -> bool:
    """Whether the tensors form a rollout."""
    if part.keys() != like.keys():
        return False
    steps, environments = part["actions"].shape[:1].numel(), like["actions"].shape[1]
    lengths = {name: steps * environments if name == "residual" else steps for name in like}
    return steps > 0 and all(
        tensor.dtype == like[name].dtype
        and tensor.shape == (lengths[name], *like[name].shape[1:])
        and bool(torch.isfinite(tensor).all())
        for name, tensor in part.items()
    )
