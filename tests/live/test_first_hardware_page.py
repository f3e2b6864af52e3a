"""docs/start/first-hardware.md does what it prints, on a stand-in of ibm_fez."""

from __future__ import annotations

import io
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from golden_cases.live import SOMEBODY
from golden_files import without_figures
from sessions import WIDTH, Transcript, blocks, typed, words_of
from standin import StandIn

PAGE = "start/first-hardware.md"
QUESTION = re.compile(r"\[y/N\]: ([yn])\n")
CTRL_C = "^C\n"


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


def machines(capsys: pytest.CaptureFixture[str]) -> str:
    """What the page's command that lists the machines of an account prints."""
    block = next(text for _, text in blocks(PAGE) if ".backends()" in text)
    name, option, code = words_of(block)
    assert (name, option) == ("python", "-c")
    exec(code, {})
    return capsys.readouterr().out.strip()


def test_the_page_prints_what_a_service_like_ibms_makes_it_say(
    empty_folder: Path,
    qcompile: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    SOMEBODY(monkeypatch)
    transcript = Transcript(PAGE, empty_folder, without_figures)
    commands = [
        each for language, block in blocks(PAGE) if language == "console" for each in typed(block)
    ]
    with StandIn({"ibm_fez": "FakeFez"}) as service:
        for name, value in service.environment().items():
            monkeypatch.setenv(name, value)
        assert machines(capsys) == "ibm_fez"
        for line, printed in commands:
            asked = QUESTION.search(printed)
            monkeypatch.setattr("sys.stdin", io.StringIO(f"{asked[1]}\n" if asked else ""))
            monkeypatch.setattr("sys.stderr", sys.stdout)  # in the order of a terminal
            if CTRL_C in printed:
                stop_at_the_third_job(service, monkeypatch)
            answer = qcompile(*words_of(line)[1:])
            now = answer.out.replace("[y/N]: ", f"[y/N]: {asked[1]}\n" if asked else "")
            if CTRL_C in printed:
                now = now.replace("Error: Interrupted.", f"{CTRL_C}Error: Interrupted.")
            transcript.compare(line, printed, now)
            assert answer.code == (CTRL_C in printed or bool(asked and asked[1] == "n"))
        charged = sum(job.charged_seconds for job in service.ledger().jobs)
    transcript.check()
    assert 20 < charged < 40  # "about 30 of them"
