"""docs/start/first-hardware.md does what it prints, on a stand-in of ibm_fez."""

from __future__ import annotations

import io
import re
import shlex
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from golden_files import without_figures
from sessions import WIDTH, blocks, said, typed
from standin import StandIn

PAGE = "start/first-hardware.md"
QUESTION = re.compile(r"(\[y/N\]: )([yn])\n")
CTRL_C = "^C\n"


def lines(text: str, here: Path) -> list[str]:
    """Its lines, sorted: what goes to which stream is not on the page; counts are drawn."""
    return sorted(filter(None, without_figures(said(text, here)).splitlines()))


def stop_at_the_third_job(service: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while the run waits for that job."""
    real = time.sleep

    def interrupt(seconds: float) -> None:
        if len(service.ledger().jobs) < 4:  # the first one calibrated
            return real(seconds)
        monkeypatch.setattr("qcompile.live.jobs.time.sleep", real)
        service.settings.run_seconds = 0.01
        raise KeyboardInterrupt

    service.settings.run_seconds = 2.0
    monkeypatch.setattr("qcompile.live.jobs.time.sleep", interrupt)


def test_the_page_prints_what_a_service_like_ibms_makes_it_say(
    empty_folder: Path, qcompile: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    commands = [
        each for language, block in blocks(PAGE) if language == "console" for each in typed(block)
    ]
    wrong = []
    with StandIn({"ibm_fez": "FakeFez"}) as service:
        for name, value in service.environment().items():
            monkeypatch.setenv(name, value)
        for line, printed in commands:
            asked = QUESTION.search(printed)
            monkeypatch.setattr("sys.stdin", io.StringIO(f"{asked[2]}\n" if asked else ""))
            if CTRL_C in printed:
                stop_at_the_third_job(service, monkeypatch)
            answer = qcompile(*shlex.split(line)[1:])
            expected = QUESTION.sub(r"\1", printed.replace(CTRL_C, ""))
            now = lines(answer.out + answer.err, empty_folder)
            refused = CTRL_C in printed or bool(asked and asked[2] == "n")
            if answer.code != refused or now != lines(expected, empty_folder):
                wrong.append(f"$ {line}\n{answer.out}{answer.err}exit {answer.code}")
        ledger = service.ledger()
    assert not wrong, "\n".join(wrong)
    charged = sum(job.charged_seconds for job in ledger.jobs)
    assert 20 < charged < 40  # "about 30 of them"
