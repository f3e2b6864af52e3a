"""The guard: nothing is spent that was not allowed, and a run stops before its limit."""

from __future__ import annotations

import io

import pytest
from live_runs import Runs, check_paid_once, played

STEP_S = 2.1792
"""A job of two circuits of 256 shots: 2 + 512 * 0.00035."""


def nothing_sent(runs: Runs) -> bool:
    return not runs.service.ledger().jobs


def test_a_plan_above_the_limit_sends_nothing(runs: Runs) -> None:
    answer = runs.run(max_qpu_seconds=6.5)
    assert answer.code == 1
    assert (
        "Error: The plan needs 6.5 QPU seconds, more than the 6.5 allowed. Nothing was sent.\n"
        "  Raise --max-qpu-seconds, or take fewer shots, episodes or steps; "
        "`qcompile plan` shows cheaper ways.\n"
    ) in answer.err
    assert nothing_sent(runs)
    assert runs.call("runs", "--json").json() == []


def test_a_limit_just_above_the_plan_is_enough(runs: Runs) -> None:
    """Whole seconds of IBM's own limit do not cut the last job off."""
    found = runs.run(max_qpu_seconds=3 * STEP_S + 0.01).json()
    assert found["qpu_seconds"] == pytest.approx(3 * STEP_S)
    check_paid_once(runs.service, 3, 3 * STEP_S + 0.01)


@pytest.mark.parametrize("answer", ["n\n", "", "\n"])
def test_a_declined_confirmation_sends_nothing(
    runs: Runs, answer: str, monkeypatch: pytest.MonkeyPatch
) -> None:

    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    words = ("run", "cartpole", "--backend", "fake_lima", "--live", "--max-qpu-seconds", 60)
    declined = runs.call(*words, "--episodes", 1, "--max-steps", 1, "--mitigation", "none")
    assert declined.code == 1
    assert "Spend them? [y/N]" in declined.err
    assert "Aborted!" in declined.err
    assert nothing_sent(runs)
    assert runs.call("runs", "--json").json() == []


def test_a_confirmed_run_is_sent(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:

    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    words = ("run", "cartpole", "--backend", "fake_lima", "--live", "--max-qpu-seconds", 60)
    options = ("--episodes", 1, "--max-steps", 1, "--mitigation", "none", "--shots", 10)
    answer = runs.call(*words, *options, "--json")
    assert answer.code == 0
    assert answer.json()["env_steps"] == 1
    assert (
        "fake_lima: 1 job, 10 executions, about 2.0 QPU seconds by IBM's estimate; " in answer.err
    )
    assert "The plan has 600 s left." in answer.err
    check_paid_once(runs.service, 1)


def test_a_machine_that_takes_longer_than_planned_is_stopped_by_what_it_charged(
    runs: Runs, undisturbed: dict[str, object]
) -> None:
    """1.5 times 2.1792 s is 3.2688 s: two jobs fit 9 s, the third would make it 9.8."""
    runs.service.settings.usage_factor = 1.5
    answer = runs.run(max_qpu_seconds=9)
    assert answer.code == 1
    assert (
        "Error: The limit of 9 QPU seconds would be passed: 6.5 s are spent, the next job takes "
        "about 3.3 s.\n"
        "  2 jobs are done, 2 steps are played; all of it is kept.\n"
    ) in answer.err
    assert "--max-qpu-seconds S` goes on with more." in answer.err
    assert runs.service.ledger().charged_seconds == pytest.approx(2 * 1.5 * STEP_S)
    again = runs.call("resume", "last")
    assert again.code == 1
    assert len(runs.service.ledger().jobs) == 2
    found = runs.call("resume", "last", "--max-qpu-seconds", 10, "--yes", "--json").json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(3 * 1.5 * STEP_S)
    assert found["max_qpu_seconds"] == 10
    check_paid_once(runs.service, 3, 10)


def test_a_job_that_ibm_cuts_off_at_the_limit_is_a_matter_of_the_budget(
    runs: Runs, undisturbed: dict[str, object]
) -> None:
    """Three times 2.2 s pass 6 s at once: IBM stops the job there, and charges so much."""
    runs.service.settings.usage_factor = 4.0
    answer = runs.run(max_qpu_seconds=7, max_steps=3)
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert (job.status, job.charged_seconds) == ("Cancelled", 7.0)
    assert f"Error: IBM cut job {job.id} off at the limit of the run.\n" in answer.err
    assert "tries again with more." in answer.err
    runs.service.settings.usage_factor = 1.0
    assert runs.call("resume", "last").code == 1
    assert len(runs.service.ledger().jobs) == 1
    found = runs.call("resume", "last", "--max-qpu-seconds", 30, "--yes", "--json").json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(7 + 3 * STEP_S)


def test_a_higher_limit_is_confirmed_and_a_lower_one_is_not(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:

    runs.service.settings.usage_factor = 1.5
    assert runs.run(max_qpu_seconds=9).code == 1
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    answer = runs.call("resume", "last", "--max-qpu-seconds", 20)
    assert answer.code == 1
    assert "Allow 20 QPU seconds instead of 9? [y/N]" in answer.err
    lower = runs.call("resume", "last", "--max-qpu-seconds", 8)
    assert lower.code == 1
    assert "The limit of 8 QPU seconds would be passed" in lower.err
    assert len(runs.service.ledger().jobs) == 2
