"""Terminal output: no control characters, no bidirectional or invisible marks."""

from __future__ import annotations

import io
import json
import sys
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qcompile.terminal import PlainStream, one_line, plain, plain_output

HOSTILE = "ibm\x1b[31m_\x1b]0;owned\x07li\u202ema\u2066\x9b2J\r\x08\u200f"
MARKS = {"RLO", "LRO", "RLE", "LRE", "PDF", "RLI", "LRI", "FSI", "PDI"}
"""The bidirectional classes of Unicode that stand for a mark and not for a letter."""


def moves_or_hides(sign: str) -> bool:
    """By Unicode's own tables."""
    return (
        (unicodedata.category(sign) == "Cc" and sign not in "\n\t")
        or unicodedata.bidirectional(sign) in MARKS
        or unicodedata.name(sign, "") in ("LEFT-TO-RIGHT MARK", "RIGHT-TO-LEFT MARK")
    )


@given(st.text())
def test_nothing_that_moves_the_cursor_or_turns_text_stays(text: str) -> None:
    assert not any(map(moves_or_hides, plain(text)))
    assert not any(sign in "\n\t" for sign in one_line(text).replace(" ", ""))


def test_every_sign_of_that_kind_is_known() -> None:
    signs = [chr(code) for code in range(0x110000) if moves_or_hides(chr(code))]
    assert len(signs) == 63 + 9 + 2  # 65 control characters but two
    assert plain("".join(signs)) == ""


@pytest.mark.parametrize("text", ["<Z> = 0.5 ± 0.1\n\tθ ϕ é 日本 שלום ▁▂▃ ─", "", "a b"])
def test_other_text_stays_as_it_is(text: str) -> None:
    assert plain(text) == text


def test_an_unfinished_escape_removes_no_text() -> None:
    assert plain("backend \x1b] is allowed 60 s") == "backend ] is allowed 60 s"


def test_one_line_of_a_field() -> None:
    assert one_line("a\x1b[31m b\n\n c\x1b]8;;http://x\x07d") == "a b cd"
    assert one_line("x" * 400) == "x" * 297 + "..."


def test_a_stream_is_plain_and_otherwise_the_same() -> None:
    inner = io.StringIO()
    stream: Any = PlainStream(inner)
    stream.writelines(["a\x1b[2J", "b\n"])
    print("c\u202e", file=stream)
    assert inner.getvalue() == "a[2Jb\nc\n"
    assert stream.isatty() is False
    assert not hasattr(stream, "buffer")  # bytes would pass it by


def test_the_streams_are_themselves_again_after_the_block() -> None:
    out, err = sys.stdout, sys.stderr
    with plain_output():
        assert (sys.stdout, sys.stderr) != (out, err)
    assert (sys.stdout, sys.stderr) == (out, err)


def test_a_table_keeps_its_own_colours_and_none_of_a_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    from qcompile.report.tables import print_table

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(sys, "stdout", terminal)
    with plain_output():
        print_table(["device"], [[HOSTILE]], HOSTILE)
    shown = terminal.getvalue()
    assert "\x1b[1m" in shown  # the header is bold
    assert "\x1b[31m" not in shown
    assert "\x1b]" not in shown
    for sign in "\x07\x08\x9b\u202e\u2066\u200f":
        assert sign not in shown


@pytest.mark.parametrize("words", [("show",), ("run",), ("export",), ("run", "--json")])
def test_text_of_files_is_shown_plain(
    qcompile: Callable[..., Any], tmp_path: Path, words: tuple[str, ...]
) -> None:
    """A policy's name and environment, in tables and in errors."""
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values

    values = policy_values(load_policy("cartpole"))
    for field in ("name", "environment"):
        path = tmp_path / f"{field}\u202e.json"
        path.write_text(json.dumps(values | {field: f"CartPole-v1{HOSTILE}"}))
        answer = qcompile(words[0], path, *words[1:])
        assert not any(map(moves_or_hides, answer.out + answer.err))


def test_wrong_usage_is_answered_plain(qcompile: Callable[..., Any]) -> None:
    for words in (
        (HOSTILE,),
        ("run", HOSTILE),
        ("run", "--backend", HOSTILE),
        ("compile", HOSTILE),
    ):
        answer = qcompile(*words)
        assert answer.code in (1, 2)
        assert not any(map(moves_or_hides, answer.out + answer.err))
