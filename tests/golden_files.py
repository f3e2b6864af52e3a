"""Golden files: what qcompile says, kept as text in tests/golden and compared letter for letter.

    QCOMPILE_GOLDEN=1 pytest tests/test_golden_*.py

rewrites them; the diff is then read like prose before it is committed. A file that is missing, or
that no test writes, is a failure.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "golden"
REWRITES = os.environ.get("QCOMPILE_GOLDEN") == "1"
WIDTH = 100
"""Columns of the terminal that the files were written on."""

_CHECKOUT = str(Path(__file__).parents[1])
_STABLE = tuple(
    (re.compile(pattern), words)
    for pattern, words in (
        (r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:\+00:00|Z)?", "TIME"),
        (r"\b\d{6}-\d{6}-([A-Za-z-]+)-[0-9a-f]{4}\b", r"yymmdd-hhmmss-\1-xxxx"),
        (r"\bafter \d\d:\d\d UTC", "after hh:mm UTC"),
        (r"\bas process \d+", "as process PID"),
        (r"(127\.0\.0\.1):\d{4,5}\b", r"\1:PORT"),
        (r"\bin \d+\.\d s\b", "in T s"),
        (r"\b\d{3,} hours old", "HOURS hours old"),
        (r"(version|qcompile|qiskit-ibm-runtime|gymnasium|numpy|torch) \d+\.\d+[\w.+]*", r"\1 V"),
        (r", now \d+\.\d+[\w.]*", ", now V"),
        (r"\b[0-9a-f]{20}\b", "JOB"),
        (r"-(?=0(?:\.0+)?(?:±| |$))", "+"),  # the sign of a rounded zero is chance
    )
)
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")


def check(name: str, text: str) -> None:
    """Compare `text` with tests/golden/`name`.txt, or write it there."""
    path = FOLDER / f"{name}.txt"
    if REWRITES:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return
    if not path.exists():
        pytest.fail(f"{path} is missing: QCOMPILE_GOLDEN=1 writes it.", pytrace=False)
    expected = path.read_text(encoding="utf-8")
    if text != expected:
        lines = difflib.unified_diff(
            expected.splitlines(), text.splitlines(), f"golden/{name}.txt", "now", lineterm=""
        )
        pytest.fail("\n".join(lines), pytrace=False)


def check_names(folder: str, names: Iterable[str]) -> None:
    """Fail where tests/golden/`folder` has a file without a case; remove it where files are
    written."""
    there = {path.stem: path for path in (FOLDER / folder).glob("*.txt")}
    unused = sorted(there.keys() - set(names))
    if REWRITES:
        for name in unused:
            there[name].unlink()
        return
    assert not unused, f"no case writes {', '.join(f'golden/{folder}/{n}.txt' for n in unused)}"


def stable(text: str, here: Path) -> str:
    """`text` with what changes from run to run in other words, and no blank at the end of a line;
    `here` is the working folder."""
    text = text.replace(f"{here}/", "").replace(str(here), ".").replace(_CHECKOUT, "CHECKOUT")
    for pattern, words in _STABLE:
        text = pattern.sub(words, text)
    return re.sub(r" +$", "", text, flags=re.MULTILINE)


def without_figures(text: str) -> str:
    """`text` with # for each number and one space for several: of what was drawn, the words."""
    lines = (re.sub(r"(?<=\S) {2,}", "  ", line) for line in _NUMBER.sub("#", text).splitlines())
    text = "\n".join(lines) + "\n" * text.endswith("\n")
    return re.sub(r"[▁-█]+…?", "█", re.sub(r"─{2,}", "─", text))
