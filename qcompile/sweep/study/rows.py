"""A study has rows; a row is trained with several seeds; a cell is a row with one seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from qcompile.errors import StudyError
from qcompile.rl.settings import Settings

ClaimSeed = Literal["mean", "best"]

_EPISODE_STEPS = 500
"""A rough number of steps per episode, to compare budgets of episodes with budgets of steps."""


@dataclass(frozen=True)
class Claim:
    """The published result for a row: in words, and the episodes to the target, if given.

    It is about the mean over the seeds, or about the best seed.
    """

    words: str = "-"
    episodes: int | None = None
    seed: ClaimSeed = "mean"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row of a study's tables: what is trained, and what it is compared with.

    `settings` are those of the preset with `changes`. `target` is the average over 20 episodes that
    counts as learned, if any. The curves of a `group` of rows have the same colour. `arguments` are
    those of the environment.
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
        """The row's seeds, or the first `count` of them, followed by higher ones if needed."""
        if count is None:
            return self.seeds
        following = max(self.seeds) + 1
        return (*self.seeds, *range(following, following + count))[:count]

    def shortened(self, episodes: int | None) -> Row:
        """The row with trainings of at most `episodes`, for a first look."""
        if episodes is None:
            return self
        fewest = min(episodes, self.settings.episodes or episodes)
        return replace(self, settings=self.settings.changed(episodes=fewest))

    @property
    def budget_steps(self) -> int:
        """A rough upper limit of the environment steps of a training."""
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
    """The cells of the rows, with all or `seeds` seeds of each; the longest trainings first."""
    longest_first = sorted(rows, key=lambda row: -row.budget_steps)
    return [Cell(row, seed) for row in longest_first for seed in row.first_seeds(seeds)]


@dataclass(frozen=True)
class Figure:
    """A figure of a study; `also` names rows of other figures that it shows too.

    The plot ends at `last_episode`, if given.
    """

    title: str
    also: tuple[str, ...] = ()
    last_episode: int | None = None


@dataclass(frozen=True)
class Rows:
    """A study: its figures by name, and its rows in the order of the figures.

    `name` is its name on the command line; `title` and `about` are at the top of its page.
    """

    name: str
    title: str
    about: str
    figures: Mapping[str, Figure]
    rows: tuple[Row, ...]

    def belongs(self, row: Row, figure: str) -> bool:
        """Whether a figure shows a row, its own or one of another figure."""
        return row.figure == figure or row.name in self.figures[figure].also

    def chosen(self, figures: Sequence[str], beginnings: Sequence[str]) -> list[Row]:
        """The rows of `figures` whose names begin with one of `beginnings`; empty means all.

        Raises:
            StudyError: there is no such figure, or no such row.
        """
        for name in figures:
            if name not in self.figures:
                raise StudyError(f"Unknown figure {name!r}.", f"Known: {', '.join(self.figures)}.")
        chosen = [
            row
            for row in self.rows
            if any(self.belongs(row, figure) for figure in figures or self.figures)
            and row.name.startswith(tuple(beginnings) or "")
        ]
        if not chosen:
            raise StudyError(
                f"There is no row whose name begins with {' or '.join(beginnings)}.",
                "--list shows the names.",
            )
        return chosen
