"""The account's key and its tokens are written nowhere, whatever goes wrong."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from live_runs import Runs
from standin import API_KEY, Fault
from standin.identity import Identity

FAULTS = [
    (Fault.SERVER_ERROR, "POST /jobs"),
    (Fault.DROPPED, "POST /jobs"),
    (Fault.ACCEPTED_DROPPED, "POST /jobs"),
    (Fault.CUT_ANSWER, "GET /jobs/{id}/results"),
    (Fault.RESULTS_TRUNCATED, None),
    (Fault.JOB_FAILS, None),
]


@pytest.fixture
def tokens(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every access token that the service gives away."""
    given: list[str] = []
    real = Identity.token

    def token(self: Identity, key: str | None) -> dict[str, object]:
        answer = real(self, key)
        given.append(str(answer["access_token"]))
        return answer

    monkeypatch.setattr(Identity, "token", token)
    return given


def check(words: list[str], tokens: list[str]) -> None:
    """No secret in the words, or in any file below the working folder and its neighbours."""
    assert tokens
    files = [path for path in Path("..").rglob("*") if path.is_file()]
    assert any(path.name.startswith("journal.sqlite") for path in files)
    contents = {str(path): path.read_bytes() for path in files}
    contents |= {f"words {index}": text.encode() for index, text in enumerate(words)}
    for name, found in contents.items():
        for secret in (API_KEY, *tokens):
            assert secret.encode() not in found, name


def test_no_secret_is_left_by_a_run_with_faults_of_all_kinds(
    runs: Runs, tokens: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.words.PATIENCE_S", 0.3)
    words: list[str] = []

    def keep(answer: object) -> None:
        words.extend([answer.out, answer.err])  # type: ignore[attr-defined]

    for kind, on in FAULTS:
        runs.service.faults.once(kind, on=on)
    keep(runs.run("--batch"))
    runs.service.faults.clear()
    runs.service.faults.once(Fault.JOB_CANCELLED)
    keep(runs.run())
    runs.service.faults.expire_tokens()
    runs.service.faults.refuse_key()
    keep(runs.call("resume", "last"))
    runs.service.faults.refuse_key(False)
    runs.service.faults.chance(Fault.DROPPED, 1.0, on="GET /jobs/{id}")
    keep(runs.call("resume", "last"))
    runs.service.faults.clear()
    keep(runs.call("resume", "last", "--json"))
    keep(runs.call("runs", "export", "last"))
    keep(runs.call("runs", "show", "last", "--json"))
    assert sum("Error: " in text for text in words) >= 3
    check(words, tokens)


def test_no_secret_is_in_a_traceback(runs: Runs, tokens: list[str]) -> None:
    """In a process of its own, where the client's own warnings and log go to the terminal."""
    runs.service.faults.chance(Fault.JOB_CANCELLED, 1.0)
    assert runs.run().code == 1
    environment = os.environ | {
        "QCOMPILE_PATIENCE_SECONDS": "0.2",
        "QISKIT_IBM_RUNTIME_LOG_LEVEL": "WARNING",
    }
    words = []
    for refused in (False, True):
        runs.service.faults.refuse_key(refused)
        shown = subprocess.run(
            [sys.executable, "-m", "qcompile", "--traceback", "resume", "last"],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert "Traceback" in shown.stderr
        words += [shown.stdout, shown.stderr]
    check(words, tokens)


def test_a_key_that_the_service_repeats_is_cut_out(
    runs: Runs, tokens: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error that quotes what it was sent."""
    from standin.errors import ApiError
    from standin.service import Service

    def submit(self: Service, body: object) -> None:
        raise ApiError(400, 1517, f"I do not like {API_KEY}.")

    monkeypatch.setattr(Service, "submit", submit)
    answer = runs.run()
    assert answer.code == 1
    assert "I do not like (token)." in answer.err
    check([answer.out, answer.err], tokens)
