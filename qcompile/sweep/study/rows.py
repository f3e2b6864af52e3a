"""A study is rows, a row is settings trained with several seeds, and a cell is one of these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from qcompile.rl.settings import Settings


@dataclass(frozen=True)
class Claim:
    """What the paper says of a row: in words, and the episodes it took to the target, if any."""

    words: str
    episodes: int | None = None


@dataclass(frozen=True)
class Row:
    """One line of a study's tables: what is trained, and what it is compared with.

    `target` is the average over 20 episodes that counts as learned.
    """

    name: str
    title: str
    figure: str
    environment: str
    preset: str
    settings: Settings
    seeds: int
    target: float
    claim: Claim


@dataclass(frozen=True)
class Cell:
    """One training: a row and a seed."""

    row: Row
    seed: int

    @property
    def name(self) -> str:
        return f"{self.row.name}-seed{self.seed}"


def cells(rows: Sequence[Row], seeds: int | None = None) -> list[Cell]:
    """Every cell of the rows, or the first `seeds` of each; the slowest environments first."""
    every = [
        Cell(row, seed) for row in rows for seed in range(row.seeds if seeds is None else seeds)
    ]
    order = {"LunarLander": 0, "Acrobot": 1, "CartPole": 2}
    return sorted(every, key=lambda cell: order.get(cell.row.environment.rsplit("-v", 1)[0], 0))
