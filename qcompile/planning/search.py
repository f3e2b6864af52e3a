"""Finds the cheapest settings that keep a policy's reward within a limit of QPU seconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.deploy.settings import RunSettings
from qcompile.errors import OptionError
from qcompile.execution import Backend, Executor
from qcompile.passes import copies_that_fit
from qcompile.planning.point import Point, best_depth, undominated
from qcompile.planning.share import Baseline
from qcompile.planning.simulation import Simulated, ideal_rewards, random_rewards, simulate
from qcompile.policy import Policy

KEEP = 0.97
LADDER = tuple(2**k for k in range(3, 14))
"""The numbers of shots tried: 8, 16, ..., 8192."""
_FIRST = 256
_WORTH = 0.97
"""A second placement of rows must cost at most this fraction of the first."""
_WORTH_A_CUT = 0.8
"""A run with cut episodes must cost at most this fraction of one with whole episodes."""
_EMPTY = 0.05
"""The largest share of a split row's shots that may stay unused in copies with fewer."""
_LEAST, _MOST = 200, 1000
"""Episodes to evaluate settings: at least, and at most to confirm them."""

Show = Callable[[float, str], None]


@dataclass(frozen=True)
class Goal:
    """The goal of a plan: `episodes` from `settings.seed` on within `within` QPU seconds.

    `settings` has level, mitigation and calibration. Settings in `fixed` (shots, copies, split,
    speculate, calibration_shots, max_steps) are kept; the others are searched for.
    """

    settings: RunSettings
    episodes: int
    within: float
    keep: float = KEEP
    fixed: dict[str, Any] = field(default_factory=dict)

    @property
    def trial_episodes(self) -> int:
        """The number of episodes that settings are first evaluated with."""
        return max(_LEAST, self.episodes)

    @property
    def confirming_episodes(self) -> int:
        """The number of episodes that recommended settings are evaluated with.

        The longest of n new episodes exceeds all of m others with probability n / (m + n): with m =
        9 n one run in ten lies above the interval, as it should.
        """
        return max(self.trial_episodes, min(9 * self.episodes, _MOST))


@dataclass(frozen=True, eq=False)
class SearchResult:
    """All evaluated points, and the recommended one if any fits."""

    goal: Goal
    points: list[Point]
    recommended: Point | None

    @property
    def frontier(self) -> list[Point]:
        """The undominated points and the recommended one, the cheapest first."""
        frontier = undominated(self.points, lambda point: (point.seconds, point.mean_reward))
        chosen = self.recommended
        if chosen is not None and chosen not in frontier:
            frontier.append(chosen)
        return sorted(frontier, key=lambda point: point.seconds)

    @property
    def closest(self) -> Point:
        """The nearest point if none fits: the cheapest that keeps the reward, or the best."""
        keeping = [point for point in self.points if point.share >= self.goal.keep]
        if keeping:
            return min(keeping, key=lambda point: point.most_seconds)
        return max(self.points, key=lambda point: point.share)

    def nearest(self) -> dict[str, Any]:
        """What would fit: fewer episodes, more seconds or a smaller share; None if nothing."""
        within, points = self.goal.within, [*self.points, *_shortened(self.points, self.goal)]
        keeping = [point for point in points if point.share >= self.goal.keep]
        cheapest = min(keeping, key=lambda point: point.most_seconds, default=None)
        fitting = [point.share for point in points if point.most_seconds <= within]
        return {
            "episodes": cheapest and _episodes_that_fit(cheapest, within),
            "within": cheapest and float(np.ceil(cheapest.most_seconds)),
            "keep": _floor(max(fitting)) if fitting else None,
        }


def search(
    policies: Sequence[Policy],
    backend: Backend | Executor,
    goal: Goal,
    show: Show = lambda done, words: None,
) -> SearchResult:
    """Play the policies with fewer and fewer shots, and choose the cheapest that keeps the reward.

    A point keeps the reward if its mean over whole episodes has at least the share `keep` of the
    noiseless gain of the best policy over random actions. Points are evaluated from 256 shots
    downwards until one fails, or upwards until one passes, and then one in between; the candidate
    is evaluated again with more episodes. Episodes are cut only if that saves a fifth of the
    seconds, or if nothing fits otherwise.

    Raises:
        OptionError: the policies have different environments, or do not beat random actions.
    """
    _check(policies)
    show(0, "random actions")
    evaluator = Evaluator(policies, goal)
    points: list[Point] = []
    for number, policy in enumerate(policies):
        progress = _PartialProgress(show, 0.8 * number / len(policies), 0.8 / len(policies))
        points += Ladder(policy, backend, goal, evaluator, progress).points()

    while (chosen := _candidate(points, goal)) is not None:
        if len(chosen.simulated.rewards) >= goal.confirming_episodes:
            break
        words = f"{chosen.policy.name}, {chosen.settings.shots} shots"
        show(0.9, f"{words}, {goal.confirming_episodes} episodes")
        confirmed = evaluator.confirm(replace(chosen, cut=goal.fixed.get("max_steps")), backend)
        points = [confirmed if p.simulated is chosen.simulated else p for p in points]
    if chosen is not None and chosen not in points:
        points.append(chosen)
    return SearchResult(goal, points, chosen)


def _candidate(points: Sequence[Point], goal: Goal) -> Point | None:
    """The cheapest point that keeps the reward and fits, cut only if that saves much."""
    keeping = [point for point in points if point.share >= goal.keep]
    whole = _cheapest(keeping, goal.within)
    cut = _cheapest(_shortened(keeping, goal), goal.within)
    if whole is None or cut is None:
        return whole or cut
    return cut if cut.most_seconds < _WORTH_A_CUT * whole.most_seconds else whole


def _shortened(points: Sequence[Point], goal: Goal) -> list[Point]:
    """The points with a cut that affects few episodes; none if the cut is fixed."""
    if "max_steps" in goal.fixed:
        return []
    return [short for point in points if (short := point.shortened()) is not None]


def _check(policies: Sequence[Policy]) -> None:
    environments = {(policy.environment, repr(policy.environment_kwargs)) for policy in policies}
    if len(environments) > 1:
        names = ", ".join(sorted({name for name, _ in environments}))
        raise OptionError(
            f"The policies play in different environments: {names}.",
            "A plan chooses among policies of one environment.",
        )


def _cheapest(points: Sequence[Point], within: float) -> Point | None:
    fitting = [point for point in points if point.most_seconds <= within]
    return min(fitting, key=lambda point: point.seconds, default=None)


def _floor(share: float) -> float:
    """The share rounded down to two digits."""
    return float(np.floor(100 * share) / 100)


def _episodes_that_fit(point: Point, within: float) -> int | None:
    """The most episodes that fit `within` seconds at the point's settings."""
    low, high = 0, point.episodes
    while high - low > 1:
        middle = (low + high) // 2
        if point.with_episodes(middle).most_seconds <= within:
            low = middle
        else:
            high = middle
    return low or None


@dataclass(frozen=True)
class _PartialProgress:
    show: Show
    start: float
    share: float

    def __call__(self, done: float, words: str) -> None:
        self.show(self.start + self.share * done, words)


class Evaluator:
    """Evaluates points against random actions and the noiseless reward of the best policy."""

    def __init__(self, policies: Sequence[Policy], goal: Goal):
        self._goal = goal
        self._random = random_rewards(policies[0], goal.settings.seed)
        ideal = [ideal_rewards(policy, goal.settings, goal.trial_episodes) for policy in policies]
        best = int(np.argmax([rewards.mean() for rewards in ideal]))
        self._best = policies[best]
        self.baseline = Baseline(self._random, ideal[best])

    @cached_property
    def _confirming_baseline(self) -> Baseline:
        goal = self._goal
        ideal = ideal_rewards(self._best, goal.settings, goal.confirming_episodes)
        return Baseline(self._random, ideal)

    def confirm(self, point: Point, backend: Backend | Executor) -> Point:
        """The point, evaluated again with `confirming_episodes`."""
        settings, episodes = point.simulated.settings, self._goal.confirming_episodes
        simulated = simulate(point.policy, backend, settings, episodes)
        return replace(point, simulated=simulated, baseline=self._confirming_baseline)


@dataclass(frozen=True, eq=False)
class Ladder:
    """The points of one policy for more and fewer shots."""

    policy: Policy
    backend: Backend | Executor
    goal: Goal
    evaluator: Evaluator
    show: Show

    def points(self) -> list[Point]:
        """The best point for each number of shots tried."""
        if "shots" in self.goal.fixed:
            return [self.point(self.goal.fixed["shots"])]
        ladder = [shots for shots in LADDER if self._placements(shots)] or [LADDER[-1]]
        first = max(_FIRST, ladder[0])
        points = [self.point(first)]
        keeps = points[0].share >= self.goal.keep
        fewer = [shots for shots in reversed(ladder) if shots < first]
        for shots in fewer if keeps else [shots for shots in ladder if shots > first]:
            points.append(self.point(shots))
            if (points[-1].share >= self.goal.keep) != keeps:
                before = points[-2].simulated.settings.shots or 0
                points.append(self.point((before + shots) // 2))
                break
        return points

    def point(self, shots: int) -> Point:
        """The point with the cheapest row placement and depth for `shots`."""
        self.show(1 - np.log2(shots) / 14, f"{self.policy.name}, {shots} shots")
        played, *others = self._placements(shots) or [self._fixed_placement()]
        first = best = self._point(self._simulated(shots, *played))
        for copies, split in others:  # priced with the same episodes, and played if it pays
            settings = RunSettings.of(first.simulated.settings, copies=copies, split=split)
            other = self._point(replace(first.simulated, settings=settings))
            if other.seconds < _WORTH * first.seconds:
                best = self._point(self._simulated(shots, copies, split))
        return min(first, best, key=lambda point: point.seconds)

    def _point(self, simulated: Simulated) -> Point:
        """The point at the fixed depth, or at the best one."""
        fixed, episodes = self.goal.fixed, self.goal.episodes
        cut = fixed.get("max_steps")
        point = Point(self.policy, simulated, self.evaluator.baseline, episodes, 1, cut)
        return best_depth(point, fixed.get("speculate"))

    def _placements(self, shots: int) -> list[tuple[int | None, bool]]:
        """Pairs of a number of copies and whether rows are split, the likelier one first.

        Split rows leave no copy empty, but with few shots the copies get unequal numbers. Empty if
        a copy of a split row would have no shot, or another copy no episode.
        """
        fixed, episodes = self.goal.fixed, self.goal.episodes
        fit = copies_that_fit(self.policy.program, self.backend.device)
        copies = fixed.get("copies", min(fit, episodes))
        split = fixed.get("copies", min(fit, shots))
        is_even = -shots % split <= _EMPTY * shots
        placements: list[tuple[int | None, bool]] = [(split, True)] * (2 <= split <= shots)
        placements += [(copies, False)] * (copies <= episodes)
        placements = [one for one in placements if fixed.get("split", one[1]) == one[1]]
        return placements if is_even else placements[::-1]

    def _fixed_placement(self) -> tuple[int | None, bool]:
        """The fixed copies and split when they are not feasible; simulating them says why.

        Raises:
            OptionError: there are more copies than episodes.
        """
        fixed = self.goal.fixed
        settings = RunSettings.of(copies=fixed.get("copies"), split=fixed.get("split", False))
        settings.check_shared(self.goal.episodes)
        return settings.copies, settings.split

    def _simulated(self, shots: int, copies: int | None, split: bool) -> Simulated:
        changes: dict[str, Any] = {"shots": shots, "copies": copies, "split": split}
        shots_of_calibration = self.goal.fixed.get("calibration_shots", "auto")
        changes["calibration_shots"] = shots_of_calibration
        settings = RunSettings.of(self.goal.settings, **changes)
        return simulate(self.policy, self.backend, settings, self.goal.trial_episodes)
