"""A live run without shots uses the plan's settings, and keeps the given ones."""

from __future__ import annotations

from typing import Any

import pytest
from live_runs import Runs

from qcompile.planning import search

LIVE = ("--live", "--yes", "--json", "--max-qpu-seconds", 60)
SMALL = ("run", "cartpole", "--backend", "fake_lima", "--episodes", 2, "--max-steps", 3)


@pytest.fixture(autouse=True)
def _few_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "_LEAST", 4)


def test_the_plan_is_told_and_played(runs: Runs) -> None:
    answer = runs.call(*SMALL, *LIVE)
    assert answer.code == 0, answer.err
    result: dict[str, Any] = answer.json()
    told, question = answer.err.splitlines()[:2]
    words = f"Planned settings: --shots {result['shots']} --speculate auto --calibration-shots "
    assert told.startswith(words)
    assert told.endswith("% of the reward. To choose others, add --shots.")
    assert "QPU seconds by IBM's estimate; the limit is 60." in question
    assert result["shots"] in search.LADDER[:7]
    assert (result["speculate"], result["max_steps"]) == ("auto", 3)
    ledger = runs.service.ledger()
    assert result["jobs"] == len(ledger.jobs)
    assert result["qpu_seconds"] == pytest.approx(ledger.charged_seconds)


def test_what_is_said_stays(runs: Runs) -> None:
    said = ("--speculate", 2, "--mitigation", "none")
    answer = runs.call(*SMALL, *said, *LIVE)
    assert answer.code == 0, answer.err
    result = answer.json()
    assert (result["speculate"], result["mitigation"], result["split"]) == (2, "none", False)


def test_with_shots_nothing_is_planned(runs: Runs) -> None:
    answer = runs.call(*SMALL, "--shots", 77, *LIVE)
    assert answer.code == 0, answer.err
    assert "planned" not in answer.err
    result = answer.json()
    assert (result["shots"], result["speculate"]) == (77, "auto")
    assert not result["split"]


def test_where_nothing_fits_the_guard_refuses(runs: Runs) -> None:
    answer = runs.call(*SMALL, "--live", "--yes", "--max-qpu-seconds", 3)
    assert answer.code == 1
    assert "Planned settings: nothing fits the limit. The nearest are --shots" in answer.err
    assert "more than the limit of 3. Nothing was sent." in answer.err
    assert "`qcompile plan` shows cheaper ways" in answer.err
    assert not runs.service.ledger().jobs
