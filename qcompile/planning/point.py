"""A point of the frontier: a policy with its settings, reward and price."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from qcompile.deploy.depth import Speculate
from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.limits import MOST_AHEAD
from qcompile.planning.cost import Packing, Price, at_sub_jobs
from qcompile.planning.share import Baseline
from qcompile.planning.simulation import Simulated
from qcompile.policy import Policy

DEPTHS: tuple[int, ...] = (1, 2, 4, 8, 16, 32, MOST_AHEAD)
_AUTO_MARGIN = 1.15
"""`auto` is chosen if it costs at most this factor more than the best depth: it adapts on the
machine, where predictions may fail more often than on the model."""
_MAX_CUT = 0.02
"""The largest share of episodes that a recommended cut may shorten."""


T = TypeVar("T")


def undominated(points: Iterable[T], place: Callable[[T], tuple[float, float]]) -> list[T]:
    """The points that no cheaper point matches or beats, the cheapest first.

    `place` gives the QPU seconds and the mean reward of a point.
    """
    best, best_points = -np.inf, list[T]()
    for point in sorted(points, key=lambda point: (place(point)[0], -place(point)[1])):
        if place(point)[1] > best:
            best = place(point)[1]
            best_points.append(point)
    return best_points


@dataclass(frozen=True, eq=False)
class Point:
    """A simulated policy, with the cost of `episodes` episodes at a depth.

    `cut` is the number of environment steps after which an episode is stopped. It affects only the
    price: rewards are those of whole episodes.
    """

    policy: Policy
    simulated: Simulated
    baseline: Baseline
    episodes: int
    speculate: Speculate
    cut: int | None = None

    @cached_property
    def packing(self) -> Packing:
        settings = self.settings
        copies = 1 if settings.split else settings.copies or 1
        return Packing(self.simulated.rounds, settings.program_shots, copies)

    @cached_property
    def price(self) -> Price:
        chains = self.simulated.chains
        if self.cut is not None:
            chains = chains.cut(-(-self.cut // self.policy.hold))
        calibration = self.simulated.calibration
        return Price(
            chains, self.episodes, self.packing, self.speculate, calibration, self.settings.seed
        )

    @cached_property
    def settings(self) -> RunSettings:
        """The settings that play it."""
        changes = {"speculate": self.speculate, "max_steps": self.cut}
        return RunSettings.of(self.simulated.settings, **changes)

    @property
    def device(self) -> Device:
        """The device it is planned for."""
        return self.simulated.device

    @property
    def seconds(self) -> float:
        """The mean QPU seconds of the episodes."""
        return self.price.seconds

    @property
    def seconds_80(self) -> tuple[float, float]:
        """The 80 % interval of the QPU seconds."""
        return self.price.seconds_80

    @property
    def most_seconds(self) -> float:
        """The seconds a limit must allow: the upper end of the interval."""
        return max(self.seconds, self.seconds_80[1])

    @property
    def mean_reward(self) -> float:
        return float(self.simulated.rewards.mean())

    @cached_property
    def share(self) -> float:
        """The share of the ideal reward over random actions that it keeps."""
        return self.baseline.share(self.simulated.rewards)

    def shortened(self) -> Point | None:
        """The point with the shortest cut affecting at most 2 % of episodes; None if useless."""
        steps = np.sort(self.simulated.steps)
        cut = int(steps[len(steps) - 1 - int(_MAX_CUT * len(steps))])
        return replace(self, cut=cut) if cut < steps[-1] else None

    def with_episodes(self, episodes: int) -> Point:
        """The same point for another number of episodes."""
        return replace(self, episodes=episodes)

    @cached_property
    def values(self) -> dict[str, Any]:
        """The plain values of `qcompile plan --json`."""
        settings, load = self.settings, self.price.load
        rewards = self.simulated.rewards
        return {
            "policy": self.policy.name,
            "hold": self.policy.hold,
            "shots": settings.shots,
            "copies": settings.copies or 1,
            "split": settings.split,
            "speculate": self.speculate,
            "max_steps": self.cut,
            "mitigation": settings.mitigation,
            "calibration_shots": settings.calibration_shots,
            "episodes": self.episodes,
            "jobs": load.jobs,
            "executions": load.executions,
            "qpu_seconds": self.seconds,
            "qpu_seconds_80": list(self.seconds_80),
            "qpu_seconds_at_4_sub_jobs": at_sub_jobs(load),
            "mean_reward": self.mean_reward,
            "ci95": bootstrap_ci95(rewards, settings.seed),
            "scored_episodes": len(rewards),
            "share": self.share,
            "share_95": list(self.baseline.share_95(rewards)),
        }


def best_depth(point: Point, speculate: Speculate | None = None) -> Point:
    """The point at the cheapest depth, or at `auto` if that costs hardly more.

    `speculate` fixes the depth, if given.
    """
    if speculate is not None:
        return replace(point, speculate=speculate)
    auto = replace(point, speculate="auto")
    fixed = min((replace(point, speculate=depth) for depth in DEPTHS), key=lambda p: p.seconds)
    return auto if auto.seconds <= _AUTO_MARGIN * fixed.seconds else fixed
