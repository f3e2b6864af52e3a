"""A study is rows, a row is settings trained with several seeds, and a cell is one of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from qcompile.errors import StudyError
from qcompile.rl.settings import Settings

ClaimSeed = Literal["mean", "best"]

_EPISODE_STEPS = 500
"""About the steps of an episode, to compare budgets of episodes with budgets of steps."""


@dataclass(frozen=True)
class Claim:
    """What is claimed of a row: in words, and the episodes it took to the target, if any.

    It is claimed of the mean over the seeds, or of the best seed.
    """

    words: str = "-"
    episodes: int | None = None
    seed: ClaimSeed = "mean"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of a study's tables: what is trained, and what it is compared with.

    `settings` are those of the preset with `changes`. `target` is the average over 20 episodes that
    counts as learned, if any. Curves of the rows of one `group` have one colour. `arguments` are
    those that the environment is made with.
    """

    name: str
    title: str
    group: str
    figure: str
    environment: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    preset: str
    settings: Settings
    changes: Mapping[str, Any] = field(default_factory=dict)
    seeds: tuple[int, ...]
    target: float | None = None
    claim: Claim = Claim()

    def first_seeds(self, count: int | None) -> tuple[int, ...]:
        """The row's seeds; with `count` so many: its first, and after its last the next numbers."""
        if count is None:
            return self.seeds
        following = max(self.seeds) + 1
        return (*self.seeds, *range(following, following + count))[:count]

    def shortened(self, episodes: int | None) -> Row:
        """The row with trainings of `episodes` at most, for a first look."""
        if episodes is None:
            return self
        fewest = min(episodes, self.settings.episodes or episodes)
        return replace(self, settings=self.settings.changed(episodes=fewest))

    @property
    def budget_steps(self) -> int:
        """About the most environment steps of a training."""
        episodes, steps = self.settings.episodes, self.settings.steps
        budgets = (steps, None if episodes is None else episodes * _EPISODE_STEPS)
        return min(budget for budget in budgets if budget is not None)


@dataclass(frozen=True)
class Cell:
    """One training: a row and a seed."""

    row: Row
    seed: int

    @property
    def name(self) -> str:
        return f"{self.row.name}-seed{self.seed}"


def cells(rows: Sequence[Row], seeds: int | None = None) -> list[Cell]:
    """Every cell of the rows, or of `seeds` seeds of each; the longest trainings first."""
    longest_first = sorted(rows, key=lambda row: -row.budget_steps)
    return [Cell(row, seed) for row in longest_first for seed in row.first_seeds(seeds)]


@dataclass(frozen=True)
class Figure:
    """A figure of a study: `also` names the rows of other figures that it shows as well.

    Its picture ends at `last_episode`, if any.
    """

    title: str
    also: tuple[str, ...] = ()
    last_episode: int | None = None


@dataclass(frozen=True)
class Rows:
    """A study: its figures by name, and its rows in the order of the figures.

    `name` is what the command line calls it, `title` and `about` stand at the head of its page.
    """

    name: str
    title: str
    about: str
    figures: Mapping[str, Figure]
    rows: tuple[Row, ...]

    def belongs(self, row: Row, figure: str) -> bool:
        """Whether a figure shows a row, be it that of another figure."""
        return row.figure == figure or row.name in self.figures[figure].also

    def chosen(self, figures: Sequence[str], beginnings: Sequence[str]) -> list[Row]:
        """The rows of these figures whose names begin with one of these; with none named, all.

        Raises:
            StudyError: there is no such figure, or no such row.
        """
        for name in figures:
            if name not in self.figures:
                raise StudyError(f"Unknown figure {name!r}.", f"Known: {', '.join(self.figures)}.")
        named = [
            row
            for row in self.rows
            if any(self.belongs(row, figure) for figure in figures or self.figures)
            and row.name.startswith(tuple(beginnings) or "")
        ]
        if not named:
            raise StudyError(
                f"No row's name begins with {' or '.join(beginnings)}.", "--list shows their names."
            )
        return named
