"""The account's key and tokens are never written anywhere, whatever goes wrong."""

from __future__ import annotations

import os
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs
from standin import API_KEY, Fault
from standin.errors import ApiError
from standin.identity import Identity
from standin.jobs import FAILED, Job
from standin.service import Service

from qcompile.cli import main
from qcompile.errors import LiveError

GIVEN: list[str] = []
"""Every access token that the service gave away in this test."""
LIVE = (
    *("--backend", "fake_lima", "--live", "--yes", "--max-qpu-seconds", "60", "--shots", "256"),
    *("--episodes", "1", "--max-steps", "1", "--mitigation", "none"),
)

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
    GIVEN.clear()
    real = Identity.token

    def token(self: Identity, key: str | None) -> dict[str, object]:
        answer = real(self, key)
        GIVEN.append(str(answer["access_token"]))
        return answer

    monkeypatch.setattr(Identity, "token", token)
    return GIVEN


def check(words: list[str], tokens: list[str]) -> None:
    """There is no secret in the output, or in any file below the working folder's parent."""
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
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.3)
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
    """An error that quotes its request."""
    monkeypatch.setattr(Service, "submit", refuse)
    answer = runs.run()
    assert answer.code == 1
    assert "I do not like (token)." in answer.err
    check([answer.out, answer.err], tokens)


def refuse(self: Service, body: object) -> None:
    """An error that quotes the key, an access token and a request's header."""
    header = "Bearer a-token-of-some-other-kind-0123"
    raise ApiError(400, 1517, f"I do not like {API_KEY}. Nor {GIVEN[-1]} or {header}.")


def test_a_traceback_holds_no_key_that_the_service_repeats(
    runs: Runs, tokens: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """Secrets are removed from all errors in the chain, on the terminal and in Python."""
    monkeypatch.setattr(Service, "submit", refuse)
    monkeypatch.setattr(sys, "argv", ["qcompile", "--traceback", "run", "cartpole", *LIVE])
    with pytest.raises(LiveError) as caught:
        main()
    shown = "".join(traceback.format_exception(caught.value))
    assert shown.count("I do not like (token). Nor (token) or (token)") >= 2
    capsys.readouterr()
    sys.excepthook(caught.type, caught.value, caught.tb)
    on_terminal = capsys.readouterr().err
    assert on_terminal.startswith("Traceback")
    check([shown, on_terminal], tokens)


def test_a_traceback_of_a_defect_holds_no_token_either(
    tokens: list[str], capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An unexpected error, with a cause and with terminal control characters."""
    monkeypatch.setenv("QISKIT_IBM_TOKEN", API_KEY)
    monkeypatch.setattr(sys, "argv", ["qcompile", "--version"])
    with pytest.raises(SystemExit):
        main()
    try:
        try:
            raise ValueError(f"in {API_KEY}\x1b[2J")
        except ValueError as error:
            raise KeyError(f"Bearer {API_KEY}") from error
    except KeyError as error:
        sys.excepthook(type(error), error, error.__traceback__)
    shown = capsys.readouterr().err
    assert "ValueError: in (token)[2J" in shown
    assert API_KEY not in shown


def test_a_reason_that_repeats_the_key_is_kept_and_shown_without_it(
    runs: Runs, tokens: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in the journal, which people share."""

    def fail(self: Job, **_: object) -> None:
        self.outcome, self.charged, self.reason_code = FAILED, 0.0, 9999
        self.reason = f"bad {API_KEY} \x1b[31mred\u202e"

    monkeypatch.setattr(Job, "fail", fail)
    runs.service.faults.chance(Fault.JOB_FAILS, 1.0)
    answer = runs.run()
    assert answer.code == 1
    shown = runs.call("runs", "show", "last")
    exported = runs.call("runs", "export", "last")
    assert "bad (token) red" in exported.json()["jobs"][0]["words"]
    assert "bad (token)" in answer.err
    assert not {"\x1b", "\u202e"} & set(answer.err + shown.out + exported.out)
    check([answer.err, shown.out, shown.err, exported.out], tokens)
