"""Accounts and backends that fail: expired tokens, refused keys, retired machines."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import API_KEY, Fault
from standin.identity import CRN

WORDS = "IBM refuses the account's token: it has expired, or belongs to another instance."


class Meanwhile(threading.Thread):
    """Does something once the service has accepted its first job."""

    def __init__(self, runs: Runs, what: Any):
        super().__init__()
        self._runs, self._what = runs, what
        self.start()

    def run(self) -> None:
        for _ in range(2000):
            if self._runs.service.ledger().jobs:
                return self._what()
            time.sleep(0.002)
        return None


@pytest.mark.parametrize("times", [1, 3])
def test_tokens_that_expire_are_renewed(
    runs: Runs, undisturbed: dict[str, Any], times: int
) -> None:
    def expire() -> None:
        for _ in range(times):
            runs.service.faults.expire_tokens()
            time.sleep(0.05)

    runs.service.settings.queue_seconds = 0.1
    meanwhile = Meanwhile(runs, expire)
    answer = runs.run()
    meanwhile.join()
    assert answer.code == 0, answer.err
    assert played(answer.json()) == undisturbed
    check_paid_once(runs.service, 3)
    assert runs.service.ledger().faults["token_expired"] >= 1


def test_short_lived_tokens(runs: Runs, undisturbed: dict[str, Any]) -> None:
    """Each token lasts half a second, a run longer: the client does not know that they expire."""
    runs.service.settings.token_seconds = 0.5
    runs.service.settings.queue_seconds = 0.3
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert runs.service.ledger().requests["POST /identity/token"] >= 2


def test_a_key_that_is_refused_is_explained_before_anything_is_sent(runs: Runs) -> None:
    runs.service.faults.refuse_key()
    answer = runs.run()
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {WORDS}\n")
    assert "Provided API key could not be found" in answer.err
    assert API_KEY not in answer.err
    assert not runs.service.ledger().jobs


def test_a_key_that_is_refused_midway_is_explained_and_nothing_is_lost(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    runs.service.settings.queue_seconds = 0.1
    meanwhile = Meanwhile(runs, runs.service.faults.refuse_key)
    answer = runs.run()
    meanwhile.join()
    assert answer.code == 1
    assert f"Error: {WORDS}\n" in answer.err
    assert "everything is kept.\n  `qcompile resume " in answer.err
    assert answer.err.endswith("` resumes it.\n")
    assert API_KEY not in answer.err + answer.out
    runs.service.faults.refuse_key(False)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)


def test_no_account_at_all_is_explained(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("QISKIT_IBM_TOKEN", "QISKIT_IBM_INSTANCE"):
        monkeypatch.delenv(name)
    answer = runs.run()
    assert answer.code == 1
    assert answer.err.startswith("Error: No account of IBM Quantum is saved on this machine.\n")
    assert "save_account(token=getpass('API key: '), instance='CRN')" in answer.err


def test_an_unknown_backend_is_answered_with_the_known_ones(runs: Runs) -> None:
    answer = runs.run(backend="ibm_nowhere")
    assert answer.code == 1
    assert answer.err == (
        "Error: The account has no backend 'ibm_nowhere'.\n"
        "  It has: fake_fez, fake_lima, fake_sherbrooke, fake_toronto.\n"
        "  The backend may have been retired; everything it measured is kept.\n"
    )


@pytest.mark.parametrize(
    ("kind", "on"),
    [(Fault.CUT_ANSWER, "GET /backends"), (Fault.UNAVAILABLE, "POST /identity/token")],
)
def test_an_outage_is_not_taken_for_a_missing_backend_or_key(
    runs: Runs, kind: Fault, on: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.4)
    runs.service.faults.chance(kind, 1.0, on=on)
    answer = runs.run()
    assert answer.code == 1
    assert answer.err.startswith("Error: IBM's service does not answer.\n  The last answer was: ")
    assert answer.err.endswith("\n  Nothing is lost: resume later.\n")


def test_a_short_outage_of_the_identity_service(runs: Runs) -> None:
    runs.service.faults.once(Fault.UNAVAILABLE, on="POST /identity/token", times=2)
    started = time.monotonic()
    assert runs.run().code == 0
    assert time.monotonic() - started < 20  # the client alone would wait for a minute


def test_a_backend_retired_midway_still_gives_what_it_measured(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """The paid job is fetched, and the next one cannot be sent: the run can be resumed later."""
    runs.service.settings.queue_seconds = 0.5
    assert runs.run("--max-wait-seconds", 0.1).code == 1
    runs.service.faults.retire("fake_lima")
    time.sleep(0.6)
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert "Error: The account has no backend 'fake_lima'.\n" in answer.err
    assert "  Jobs done: 1, steps played: 1; everything is kept.\n" in answer.err
    [job] = runs.service.ledger().jobs
    assert job.results_fetched == 1
    runs.service.settings.queue_seconds = 0.0
    runs.service.faults.restore("fake_lima")
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("kind", [Fault.SERVER_ERROR, Fault.DROPPED])
def test_a_service_that_does_not_answer_is_asked_for_a_while_and_explained(
    runs: Runs, kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.4)
    runs.service.faults.chance(kind, 1.0, on="GET /jobs/{id}")
    answer = runs.run()
    assert answer.code == 1
    assert "Error: IBM's service does not answer.\n  The last answer was: " in answer.err
    assert "\n  Nothing is lost: resume later.\n  Jobs done: 0, steps played: 0; " in answer.err
    runs.service.faults.clear()
    runs.until_finished(runs.call("resume", "last", "--json"))
    check_paid_once(runs.service, 3)


def test_a_run_keeps_to_the_instance_it_began_with(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the account names later: another instance may cost money."""
    runs.service.settings.queue_seconds = 0.2
    assert runs.run("--max-wait-seconds", 0.05).code == 1
    assert runs.call("runs", "export", "last").json()["settings"]["instance"] == CRN
    monkeypatch.setenv("QISKIT_IBM_INSTANCE", CRN.replace("a/0", "a/9"))
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
