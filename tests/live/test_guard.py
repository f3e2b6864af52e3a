"""The guard: nothing is spent without permission, and a run stops before its limit."""

from __future__ import annotations

import io

import pytest
from live_runs import Runs, check_paid_once, played

STEP_S = 2.1792
"""A job of two circuits of 256 shots: 2 + 512 * 0.00035."""


def nothing_sent(runs: Runs) -> bool:
    return not runs.service.ledger().jobs


@pytest.mark.parametrize("spare_s", [-0.1, 0.0, 0.99])
def test_a_plan_above_the_limit_sends_nothing(runs: Runs, spare_s: float) -> None:
    """IBM stops jobs at whole seconds: one second is kept in reserve."""
    limit_s = 3 * STEP_S + spare_s
    answer = runs.run(max_qpu_seconds=limit_s)
    assert answer.code == 1
    assert (
        "Error: The run needs 6.5 QPU seconds and 1 in reserve, more than the limit of "
        f"{limit_s:g}. Nothing was sent.\n"
        "  Raise --max-qpu-seconds, or use fewer shots, episodes or steps. "
        "`qcompile plan --within SECONDS` finds cheaper settings.\n"
    ) in answer.err
    assert nothing_sent(runs)
    assert runs.call("runs", "--json").json() == []


def test_a_limit_one_second_above_the_plan_is_enough(runs: Runs) -> None:
    """IBM's limit in whole seconds does not stop the last job."""
    found = runs.run(max_qpu_seconds=3 * STEP_S + 1.001).json()
    assert found["qpu_seconds"] == pytest.approx(3 * STEP_S)
    assert found["jobs_uncharged"] == 0
    check_paid_once(runs.service, 3, 3 * STEP_S + 1.001)


@pytest.mark.parametrize("answer", ["n\n", "", "\n"])
def test_a_declined_confirmation_sends_nothing(
    runs: Runs, answer: str, monkeypatch: pytest.MonkeyPatch
) -> None:

    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    words = ("run", "cartpole", "--backend", "fake_lima", "--live", "--max-qpu-seconds", 60)
    options = ("--episodes", 1, "--max-steps", 1, "--mitigation", "none", "--shots", 10)
    declined = runs.call(*words, *options)
    assert declined.code == 1
    assert "Spend this QPU time? [y/N]" in declined.err
    assert (
        "Error: The question was not answered. Nothing was sent.\n  In a script, add --yes."
        in declined.err
    )
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
        "Error: The limit of 9 QPU seconds would be exceeded: 6.5 s are spent or may still be "
        "charged, and the next job takes about 3.3 s.\n"
        "  Jobs done: 2, steps played: 2; everything is kept.\n"
        "  `qcompile resume "
    ) in answer.err
    assert "--max-qpu-seconds S` resumes it with a higher limit." in answer.err
    assert runs.service.ledger().charged_seconds == pytest.approx(2 * 1.5 * STEP_S)
    again = runs.call("resume", "last")
    assert again.code == 1
    assert len(runs.service.ledger().jobs) == 2
    found = runs.call("resume", "last", "--max-qpu-seconds", 11, "--yes", "--json").json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(3 * 1.5 * STEP_S)
    assert found["max_qpu_seconds"] == 11
    check_paid_once(runs.service, 3, 11)


def test_a_job_that_ibm_cuts_off_at_the_limit_is_a_matter_of_the_budget(
    runs: Runs, undisturbed: dict[str, object]
) -> None:
    """Four times 2.2 s exceed 8 s at once: IBM stops the job there, and charges 8 s."""
    runs.service.settings.usage_factor = 4.0
    answer = runs.run(max_qpu_seconds=8)
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert (job.status, job.charged_seconds) == ("Cancelled", 8.0)
    assert (
        f"Error: IBM stopped job {job.id} at 8 s.\n"
        "  It was expected to take 2.2 s.\n"
        "  Jobs done: 0, steps played: 0; everything is kept.\n"
        "  `qcompile resume "
    ) in answer.err
    assert answer.err.endswith(" --max-qpu-seconds S` resumes it with a higher limit.\n")
    runs.service.settings.usage_factor = 1.0
    again = runs.call("resume", "last")
    assert again.code == 1
    assert (
        f"Error: Job {job.id} returned no counts. IBM says: Job ran longer than its maximum "
        "execution time of 8 s. (code 1305)\n"
        "  It was charged 8 s. It is sent and paid for again only if you allow it.\n"
    ) in again.err
    assert len(runs.service.ledger().jobs) == 1
    found = runs.call("resume", "last", "--max-qpu-seconds", 30, "--yes", "--json").json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(8 + 3 * STEP_S)


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
    assert "The limit of 8 QPU seconds would be exceeded" in lower.err
    assert len(runs.service.ledger().jobs) == 2


@pytest.mark.parametrize("lag_s", [0.15, 3600.0])
@pytest.mark.parametrize("factor", [1.5, 4.0])
@pytest.mark.parametrize("limit_s", [8.0, 20.5])
def test_the_limit_holds_whatever_is_charged_and_whenever_ibm_says_it(
    runs: Runs, monkeypatch: pytest.MonkeyPatch, lag_s: float, factor: float, limit_s: float
) -> None:
    """Checked with the ledger: jobs whose charges come late and exceed the plan."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.05, 0.15))
    runs.service.settings.usage_lag_seconds = lag_s
    runs.service.settings.usage_factor = factor
    answer = runs.run(max_qpu_seconds=limit_s)
    for _ in range(2):
        assert runs.service.ledger().charged_seconds <= limit_s
        answer = runs.call("resume", "last", "--json")
    assert 0 < runs.service.ledger().charged_seconds <= limit_s
    if factor * 3 * STEP_S > limit_s:
        assert answer.code == 1
        words = (
            "QPU seconds would be exceeded",
            "It is sent and paid for again only if you allow it.",
        )
        assert any(part in answer.err for part in words)
    elif lag_s < 1:
        assert answer.code == 0


def test_charges_that_never_come_stop_a_run_and_are_learnt_later(
    runs: Runs, undisturbed: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first job may take all of 9 s, as long as nobody knows that it took 2.2."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    runs.service.settings.usage_lag_seconds = 3600
    answer = runs.run(max_qpu_seconds=9)
    assert answer.code == 1
    assert (
        "Error: The limit of 9 QPU seconds would be exceeded: 9.0 s are spent or may still be "
        "charged, and the next job takes about 2.2 s.\n"
        "  Jobs done: 1, steps played: 1; everything is kept.\n"
    ) in answer.err
    assert len(runs.service.ledger().jobs) == 1
    runs.service.settings.usage_lag_seconds = 0
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    assert (found["qpu_seconds"], found["jobs_uncharged"]) == (pytest.approx(3 * STEP_S), 0)
    check_paid_once(runs.service, 3, 9)


def test_the_plan_of_ibm_is_a_limit_as_well(runs: Runs) -> None:
    runs.service.settings.usage_limit_seconds = 6
    answer = runs.run()
    assert answer.code == 1
    assert (
        "Error: The run needs 6.5 QPU seconds, but IBM's plan has only 6 left: its jobs would "
        "stay in the queue. Nothing was sent.\n"
        "  The Open Plan gives 600 in 28 days. To use another instance, add --instance.\n"
    ) in answer.err
    assert nothing_sent(runs)
