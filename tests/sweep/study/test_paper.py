"""The rows of the paper's study."""

from __future__ import annotations

from collections import Counter

import gymnasium
import pytest

from qcompile.errors import StudyError
from qcompile.rl.presets import settings_for
from qcompile.sweep.study.paper import belongs, figures, rows, rows_of, shortened
from qcompile.sweep.study.rows import Row, cells

BY_NAME = {row.name: row for row in rows()}


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.name)
def test_a_row_can_be_trained(row: Row) -> None:
    assert row.settings.check() is row.settings
    assert row.environment in gymnasium.registry
    assert row.figure in figures()
    assert row.seeds >= 5


def test_names_and_titles_are_unique() -> None:
    assert len(BY_NAME) == len(rows())
    labels = Counter((row.figure, row.title, row.preset) for row in rows())
    assert set(labels.values()) == {1}, "lines of a figure that cannot be told apart"


def test_the_lunarlander_circuits_have_ten_seeds() -> None:
    """The paper shows the best of 10."""
    assert BY_NAME["lunarlander-svqc-paper"].seeds == 10


def test_rows_are_the_presets_or_what_the_paper_says() -> None:
    assert BY_NAME["cartpole-svqc-paper"].settings == settings_for("paper", "CartPole-v1")
    assert BY_NAME["lunarlander-svqc-tuned"].settings == settings_for("tuned", "LunarLander-v3")
    assert BY_NAME["cartpole-v0-svqc-paper"].settings.layout == "single"
    assert BY_NAME["cartpole-fcn-small-paper"].settings.hidden == (51,)
    assert BY_NAME["acrobot-fcn-small-paper"].settings.hidden == (25,)
    reuses = {row.settings.reuse for row in rows_of(("reuse",))}
    assert reuses == {4, 8, 16, 32}


def test_the_reuse_figure_has_the_papers_own_row() -> None:
    names = [row.name for row in rows_of(("reuse",))]
    assert "cartpole-svqc-paper" in names
    assert len(names) == 4
    assert belongs(BY_NAME["cartpole-svqc-paper"], "cartpole")
    assert not belongs(BY_NAME["cartpole-svqc-tuned"], "reuse")


def test_figures_choose_rows() -> None:
    assert rows_of(()) == rows()
    acrobot = rows_of(("acrobot",))
    assert {row.environment for row in acrobot} == {"Acrobot-v1"}
    both = rows_of(("acrobot", "cartpole-v0"))
    assert len(both) == len(acrobot) + 1
    with pytest.raises(StudyError, match=r"Unknown figure 'pong'.\n  Known: cartpole, reuse,"):
        rows_of(("acrobot", "pong"))


def test_a_shortened_row_has_at_most_so_many_episodes() -> None:
    assert shortened(BY_NAME["cartpole-svqc-paper"], 7).settings.episodes == 7
    assert shortened(BY_NAME["cartpole-svqc-tuned"], 7).settings.episodes == 7
    assert shortened(BY_NAME["acrobot-svqc-paper"], 10_000).settings.episodes == 300


def test_cells_are_rows_times_seeds_the_slowest_first() -> None:
    every = cells(rows())
    assert len(every) == sum(row.seeds for row in rows()) == len({cell.name for cell in every})
    order = list(dict.fromkeys(cell.row.environment[:7] for cell in every))
    assert order == ["LunarLa", "Acrobot", "CartPol"]
    two = cells(rows_of(("cartpole-v0",)), 2)
    assert [cell.name for cell in two] == [f"cartpole-v0-svqc-paper-seed{i}" for i in (0, 1)]
