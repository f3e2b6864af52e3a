"""The report of an evaluation: whose score it is, and what the figure has beside the table."""

from __future__ import annotations

from typing import Any

import pytest

from qcompile.page.document import Facts, Picture, Score, Table
from qcompile.page.evaluation import evaluation_document
from qcompile.report.figure import Figure
from qcompile.report.intervals import draw_intervals
from qcompile.report.style import AnyStyle
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation.run import Evaluation
from qcompile.sweep.evaluation.write_up import interval, reference_line
from qcompile.verbs.evaluate import EvaluationResult


def cell(policy: str, mean: float, reference: bool = False, **changes: Any) -> dict[str, Any]:
    values: dict[str, Any] = {
        "policy": policy,
        "environment": "CartPole-v1",
        "backend": "ideal" if reference else "fake_lima",
        "calibration": None,
        "shots": "exact" if reference else 64,
        "mitigation": "none",
        "level": 2,
        "seed": 0,
        "greedy": False,
        "mean_reward": mean,
        "std_reward": 1.0,
        "ci95": [mean - 100, mean + 100],
        "paired_difference": 0.0 if reference else mean - 500,
        "reference": reference,
        "solved": None,
        "threshold": None,
        "episodes": [{"seed": seed, "reward": mean} for seed in range(5)],
    }
    return values | changes


def draw(policy: str, style: AnyStyle) -> Figure:
    return draw_intervals(policy, [], style)


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Picture, "of", lambda label, draw, text="": Picture(label, "", "", text))


def test_the_headline_has_every_policy() -> None:
    cells = [cell("a", 500, True), cell("a", 449), cell("a", 470), cell("b", 12, True)]
    facts = dict(evaluation_document([*cells, cell("b", 8.5)], draw).facts)
    assert facts["a, mean rewards"] == "449.0 to 470.0"
    assert facts["b, mean rewards"] == "8.50"
    alone = dict(evaluation_document(cells[:3], draw).facts)
    assert alone == {
        "without noise": "500.0",
        "95 % interval without noise": "400.0 to 600.0",
        "mean rewards, lowest to highest": "449.0 to 470.0",
        "differences to ideal, lowest to highest": "-51.0 to -30.0",
        "cells": "3",
    }


def test_the_score_is_the_lowest_difference_of_all_policies() -> None:
    """Policy a has the highest mean, b loses most: 449 - 500 against 12 - 40."""
    worst = cell("a", 449, paired_ci95=[-60.5, -41.5])
    cells = [cell("a", 500, True), cell("a", 470), worst, cell("b", 40, True)]
    lost = cell("b", 12, paired_difference=-28)
    assert evaluation_document([*cells, lost], draw).score == Score(
        "lowest difference to ideal",
        "-51.0",
        interval="95 % interval -60.5 to -41.5; a on fake_lima, 64 shots, no mitigation; "
        "the lowest of 3 cells",
    )


def test_the_score_is_of_the_first_environment() -> None:
    far = [cell("c", mean, environment="Acrobot-v1", paired_difference=-900) for mean in (-90, -80)]
    score = evaluation_document([cell("a", 449), cell("a", 470), *far], draw).score
    assert score is not None
    assert (score.label, score.value) == ("lowest difference to ideal in CartPole-v1", "-51.0")


def test_without_a_reference_the_score_says_of_how_many_it_is_the_highest() -> None:
    cells = [cell(name, mean, paired_difference=None) for name, mean in (("a", 7), ("b", 9))]
    score = evaluation_document(cells, draw).score
    assert score is not None
    assert (score.label, score.value) == ("highest mean reward", "9.00")
    assert score.interval.endswith(
        "b on fake_lima, 64 shots, no mitigation; the highest of 2 cells"
    )


@pytest.mark.parametrize("reference", [True, False])
def test_one_cell_has_its_mean_and_no_range(reference: bool) -> None:
    document = evaluation_document([cell("a", 449, reference)], draw)
    assert document.score is not None
    assert (document.score.label, document.score.value) == ("mean reward", "449.0")
    assert "lowest" not in " ".join(dict(document.facts))


def test_of_many_policies_the_headline_has_the_first() -> None:
    facts = dict(evaluation_document([cell(str(n), n) for n in range(9)], draw).facts)
    named = [f"{policy}, mean rewards" for policy in range(4)]
    assert [*facts] == [*named, "more policies", "cells"]


def test_settings_have_what_is_held_and_the_arguments() -> None:
    held = cell("b", 1, hold=4, environment_kwargs={"is_slippery": False})
    document = evaluation_document([cell("a", 1), held], draw)
    (settings,) = document.sections[-1].blocks
    assert isinstance(settings, Facts)
    found = dict(settings.pairs)
    assert found["environments"] == "CartPole-v1, CartPole-v1 (is_slippery=false)"
    assert found["each decision"] == (
        "a: held for 1 environment step; b: held for 4 environment steps"
    )


@pytest.mark.parametrize("episodes", [1, 4, 5])
def test_the_figure_has_the_intervals_of_the_table(episodes: int) -> None:
    few = [{"seed": seed, "reward": 400} for seed in range(episodes)]
    values = cell("a", 400, episodes=few)
    drawn = interval(values)
    ends = (300, 500) if episodes == 5 else (400, 400)
    assert (drawn.low, drawn.high) == ends
    assert reference_line([values | {"reference": True}]) == (400, *ends)
    picture, table = evaluation_document([values], draw).sections[0].blocks
    assert isinstance(picture, Picture)
    assert isinstance(table, Table)
    assert ("no interval" in picture.text) == (table.rows[0][-3] == "-") == (episodes < 5)


def test_the_page_and_the_table_have_the_warnings() -> None:
    misfit = {"qubit": 3, "part": "readout", "chi_square": 99.0, "degrees": 2, "p_value": 1e-9}
    cells = (cell("a", 1, calibration_misfits=[misfit]),)
    failures = (CellFailure("clients-acme-p.json-6c223209-fake_lima", "It broke."),)
    typed = frozenset({"clients/acme/p.json"})
    result = EvaluationResult(Evaluation((), cells, 1, 0, failures, (), typed), ())
    misfitting, failing = result.document("").warnings
    assert misfitting.startswith("fake_lima: The readout of qubit 3 ")
    assert failing == "p.json-fake_lima: It broke."
    assert result.table().notes[0] == misfitting
    assert result.table().notes[1].endswith("It broke.")
