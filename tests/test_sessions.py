"""Pages that are typed along: their commands answer what the page prints.

The blocks `console` and `py` of a page run one after the other in one folder. A block `text` right
after one of Python is what that prints.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sessions import WIDTH, blocks, matches, said, typed

PAGES = ("start/getting-started.md", "howto/paper-figure.md")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    return tmp_path


@pytest.mark.parametrize("page", PAGES)
def test_a_page_prints_what_its_commands_answer(
    page: str, folder: Path, qcompile: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    ran, printed, wrong = 0, None, []
    for language, block in blocks(page):
        if language == "console":
            for line, expected in typed(block):
                name, *words = shlex.split(line)
                assert name == "qcompile", line
                answer = qcompile(*words)
                now = said(answer.out + answer.err, folder)
                if answer.code or not matches(said(expected, folder), now):
                    wrong.append(f"$ {line}\n{now}")
                ran += 1
        elif language == "py":
            exec(compile(block, page, "exec"), {"__name__": "__main__"})
            printed = capsys.readouterr().out
        elif language == "text" and printed is not None:
            assert matches(said(block, folder), said(printed, folder)), printed
            printed = None
    assert ran > 1
    assert not wrong, "\n".join(wrong)


def test_another_answer_would_be_noticed() -> None:
    assert matches("a\n...\nd\n", "a\nb\nc\nd\n")
    assert matches("a\n...\n", "a\n")
    assert not matches("a\n...\nd\n", "a\nb\nc\n")
    assert not matches("mean 500.0\n", "mean 499.0\n")
