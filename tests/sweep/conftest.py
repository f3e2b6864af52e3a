"""Rows and results made by hand, and rows of the paper cut down to a blink."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import pytest
import torch

from qcompile.rl.settings import Settings
from qcompile.sweep.study.cell import CellResult
from qcompile.sweep.study.rows import Claim, Row
from qcompile.sweep.study.studies import open_study
from qcompile.sweep.study.summary import RowSummary


@pytest.fixture(autouse=True)
def same_threads() -> Iterator[None]:
    """A cell that runs in this process sets the number of threads: put it back."""
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def short_row() -> Callable[..., Row]:
    """A row of the paper by name, with these settings: 3 episodes where nothing is said."""

    def make(name: str = "cartpole-svqc-paper", **changes: Any) -> Row:
        (row,) = (row for row in open_study("paper").rows if row.name == name)
        return replace(row, settings=row.settings.changed(**{"episodes": 3} | changes))

    return make


@pytest.fixture
def summary() -> Callable[..., RowSummary]:
    """A row, made by hand, with a result for each list of rewards."""

    def make(
        *rewards: Sequence[float],
        claim: Claim | None = None,
        evaluation: Sequence[Sequence[float]] | None = None,
        **changes: Any,
    ) -> RowSummary:
        values = {
            "name": "cartpole-svqc-paper",
            "title": "SVQC",
            "group": "SVQC",
            "figure": "cartpole",
            "environment": "CartPole-v1",
            "preset": "paper",
            "settings": Settings(episodes=1),
            "seeds": tuple(range(len(rewards))),
            "target": 10.0,
            "claim": claim or Claim(),
        }
        row = Row(**values | changes)
        results = tuple(
            CellResult(
                row=row.name,
                seed=seed,
                environment=row.environment,
                settings={},
                versions={"torch": "1.2", "numpy": "3.4"},
                parameters=1234,
                steps=[10 * (i + 1) for i in range(len(of_seed))],
                rewards=list(of_seed),
                evaluation=[1.0, 3.0] if evaluation is None else list(evaluation[seed]),
                wall_seconds=1.0,
            )
            for seed, of_seed in enumerate(rewards)
        )
        return RowSummary(row, results)

    return make
