"""The report of a run: each of its numbers in one place."""

from __future__ import annotations

import pytest

import qcompile
from qcompile.page.document import Facts, Picture, Qubits


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Picture, "of", lambda label, draw, text="": Picture(label, "", "", text))


def test_the_cost_is_in_the_budget_alone_and_errors_at_the_shots_of_the_run() -> None:
    result = qcompile.run("cartpole", "ibm_lima", episodes=2, max_steps=5, shots=64, progress=False)
    document = result.document("")
    found = {section.title: section.blocks for section in document.sections}
    (settings,), (budget,) = found["Settings"], found["Budget"]
    assert isinstance(settings, Facts)
    assert isinstance(budget, Facts)
    assert "jobs" in dict(budget.pairs)
    assert "each step" in dict(settings.pairs)
    assert not [name for name, words in settings.pairs if "job" in words or "QPU" in words]
    assert dict(document.facts)["shots per circuit"] == "64"
    (placement,) = found["Placement"]
    assert isinstance(placement, Qubits)
    assert "at 64 shots" in placement.note


def test_settings_of_a_live_run_keep_its_id() -> None:
    from qcompile.report.summary import run_facts

    result = qcompile.run("cartpole", "ibm_lima", episodes=1, max_steps=5, progress=False)
    spent = {"run": "261127-x", "max_qpu_seconds": 9, "qpu_seconds": 2, "qpu_seconds_settled": 1}
    facts = dict(run_facts({**result.to_dict(), **spent}))
    assert facts["run"] == "261127-x"
    assert "paid" not in facts
