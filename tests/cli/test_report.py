"""`--report`: a page beside the answer of a command, checked before anything is played."""

from __future__ import annotations

import re
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]


@pytest.fixture
def unplayed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is played."""

    def play(*_: Any, **__: Any) -> None:
        pytest.fail("played before the files were checked")

    monkeypatch.setattr("qcompile.verbs.run.play", play)


def test_a_page_and_a_document(qcompile: Call, policy: Call, left: Call) -> None:
    words = ("run", policy(), "--episodes", 2, "--json", "--report", "out/a.html")
    answer = qcompile(*words)
    assert (answer.code, answer.err) == (0, "report written to out/a.html\n")
    assert answer.json()["policy"] == "tiny"
    assert left() == ["out", "out/a.html", "tiny.json"]
    page = unescape(Path("out/a.html").read_text())
    assert "qcompile run tiny.json --episodes 2 --json --report out/a.html" in page
    mean = answer.json()["mean_reward"]
    assert f'<p class="value">{mean:.1f}</p>' in page


def test_the_same_run_gives_the_same_page(qcompile: Call, policy: Call) -> None:
    """But for the times that it took and when it was written."""
    pages = []
    for _ in range(2):
        assert qcompile("run", policy(), "--episodes", 2, "--report", "a.html").code == 0
        lines = Path("a.html").read_text().splitlines()
        pages.append([line for line in lines if not re.search("UTC|<dt>played</dt>", line)])
    assert pages[0] == pages[1]


@pytest.mark.usefixtures("unplayed")
def test_what_is_no_page_is_refused_first(qcompile: Call, policy: Call, left: Call) -> None:
    answer = qcompile("run", policy(), "--report", "a.pdf")
    assert answer.code == 2
    assert "a.pdf must end with .html." in answer.err
    assert left() == ["tiny.json"]


@pytest.mark.usefixtures("unplayed")
def test_a_page_that_cannot_be_written_is_refused_first(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--report", "tiny.json/a.html")
    assert answer.code == 1
    assert "Cannot write tiny.json/a.html." in answer.err


@pytest.mark.usefixtures("nothing_is_measured")
def test_a_page_takes_no_other_file_of_the_command(qcompile: Call) -> None:
    words = ("calibrate", "--backend", "ibm_lima", "--out", "a.html", "--report", "./a.html")
    answer = qcompile(*words)
    assert answer.code == 2
    assert "--out and --report are the same file, a.html." in answer.err


def test_an_interrupted_run_says_so(
    qcompile: Call, policy: Call, ctrl_c: Callable[[int], None]
) -> None:
    ctrl_c(2)
    answer = qcompile("run", policy(), "--episodes", 5, "--report", "a.html")
    assert answer.code == 1
    warning = "interrupted: 2 of 5 episodes finished"
    assert f'<p class="warning"><strong>Note</strong> {warning}</p>' in Path("a.html").read_text()


def test_a_grid_has_a_page(qcompile: Call, policy: Call) -> None:
    few = ("--shots", 16, "--mitigation", "none", "--episodes", 2, "--workers", 1, "--out", "e")
    answer = qcompile("evaluate", policy(), *few, "--report", "a.html", "--json")
    assert answer.code == 0
    page = unescape(Path("a.html").read_text())
    for cell in answer.json()["results"]:
        assert f"<td>{cell['mitigation']}</td>" in page
        assert f"{cell['mean_reward']:.1f} ± {cell['std_reward']:.1f}" in page


def test_a_calibration_that_no_longer_holds_has_a_page(qcompile: Call, calibration: str) -> None:
    words = ("calibrate", "--backend", "fake_lima", "--check", calibration, "--seed", 2)
    answer = qcompile(*words, "--max-age-hours", 1e-9, "--report", "a.html")
    assert answer.code == 1
    page = Path("a.html").read_text()
    assert f"{calibration} no longer holds." in page
    assert 'id="check"' in page
