"""The rows of the paper's study."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import gymnasium
import pytest

from qcompile.errors import StudyError
from qcompile.rl.presets import settings_for
from qcompile.sweep.study.rows import Row, cells
from qcompile.sweep.study.studies import open_study

PAPER = open_study("paper")
BY_NAME = {row.name: row for row in PAPER.rows}


def rows_of(*figures: str) -> list[Row]:
    return PAPER.chosen(figures, ())


@pytest.mark.parametrize("row", PAPER.rows, ids=lambda row: row.name)
def test_a_row_can_be_trained(row: Row) -> None:
    assert row.settings.check() is row.settings
    assert row.environment in gymnasium.registry
    assert row.figure in PAPER.figures
    assert len(row.seeds) >= 5


def test_names_and_titles_are_unique() -> None:
    assert len(BY_NAME) == len(PAPER.rows)
    labels = Counter((row.figure, row.title, row.preset) for row in PAPER.rows)
    assert set(labels.values()) == {1}, "lines of a figure that cannot be told apart"


def test_the_lunarlander_circuits_have_ten_seeds() -> None:
    """The paper shows the best of 10."""
    assert BY_NAME["lunarlander-svqc-paper"].seeds == tuple(range(10))


def test_rows_are_the_presets_or_what_the_paper_says() -> None:
    assert BY_NAME["cartpole-svqc-paper"].settings == settings_for("paper", "CartPole-v1")
    assert BY_NAME["lunarlander-svqc-tuned"].settings == settings_for("tuned", "LunarLander-v3")
    assert BY_NAME["cartpole-v0-svqc-paper"].settings.layout == "single"
    assert BY_NAME["cartpole-fcn-small-paper"].settings.hidden == (51,)
    assert BY_NAME["acrobot-fcn-small-paper"].settings.hidden == (25,)
    reuses = {row.settings.reuse for row in rows_of("reuse")}
    assert reuses == {4, 8, 16, 32}


def test_the_reuse_figure_has_the_papers_own_row() -> None:
    names = [row.name for row in rows_of("reuse")]
    assert "cartpole-svqc-paper" in names
    assert len(names) == 4
    assert PAPER.belongs(BY_NAME["cartpole-svqc-paper"], "cartpole")
    assert not PAPER.belongs(BY_NAME["cartpole-svqc-tuned"], "reuse")


def test_figures_choose_rows() -> None:
    assert rows_of() == [*PAPER.rows]
    acrobot = rows_of("acrobot")
    assert {row.environment for row in acrobot} == {"Acrobot-v1"}
    both = rows_of("acrobot", "cartpole-v0")
    assert len(both) == len(acrobot) + 1
    with pytest.raises(StudyError, match=r"Unknown figure 'pong'.\n  Known: cartpole, reuse,"):
        rows_of("acrobot", "pong")


def test_a_shortened_row_has_at_most_so_many_episodes() -> None:
    assert BY_NAME["cartpole-svqc-paper"].shortened(7).settings.episodes == 7
    assert BY_NAME["cartpole-svqc-tuned"].shortened(7).settings.episodes == 7
    assert BY_NAME["acrobot-svqc-paper"].shortened(10_000).settings.episodes == 300
    lander = BY_NAME["lunarlander-svqc-tuned"].shortened(7).settings
    assert (lander.episodes, lander.steps) == (7, 2_000_000)


@pytest.mark.parametrize(
    ("seeds", "count", "expected"),
    [
        ((0, 1, 2), None, (0, 1, 2)),
        ((0, 1, 2), 2, (0, 1)),
        ((0, 1, 2), 5, (0, 1, 2, 3, 4)),
        ((7, 3), 1, (7,)),
        ((7, 3), 4, (7, 3, 8, 9)),
    ],
)
def test_so_many_seeds_are_the_first_and_then_the_next_numbers(
    seeds: tuple[int, ...], count: int | None, expected: tuple[int, ...]
) -> None:
    row = replace(BY_NAME["cartpole-svqc-paper"], seeds=seeds)
    assert row.first_seeds(count) == expected


def test_cells_are_rows_times_seeds_the_longest_first() -> None:
    """A budget of 150 episodes counts as 75,000 steps, the lesser of two budgets counts."""
    every = cells(PAPER.rows)
    assert len(every) == sum(len(row.seeds) for row in PAPER.rows) == len({c.name for c in every})
    assert every[0].row.settings.steps == 2_000_000
    assert BY_NAME["cartpole-svqc-tuned"].budget_steps == 75_000
    steps = [cell.row.budget_steps for cell in every]
    assert steps == sorted(steps, reverse=True)
    two = cells(rows_of("cartpole-v0"), 2)
    assert [cell.name for cell in two] == [f"cartpole-v0-svqc-paper-seed{i}" for i in (0, 1)]


def test_a_claim_of_the_best_seed_is_lunarlanders() -> None:
    best = {row.name for row in PAPER.rows if row.claim.seed == "best"}
    assert best == {"lunarlander-svqc-paper", "lunarlander-fcn-large-paper"}
