"""Characters: what is refused on the way in cannot be in what leaves."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import qcompile
from qcompile.calibration import Calibration
from qcompile.characters import for_markup, is_line
from qcompile.errors import StudyError
from qcompile.page.document import Document, Facts, Section
from qcompile.page.render import render
from qcompile.report.figure import literal
from qcompile.report.rewards import draw_rewards
from qcompile.report.table import Column, Table
from qcompile.sweep.study.rows_file import read_rows

EVERY = "".join(map(chr, range(sys.maxunicode + 1)))
TURNING = "\u202eevil\u202c \u2066x\u2069\u200f"
"""Marks that turn what stands beside them."""


def is_xml(letter: str) -> bool:
    """Char of XML 1.0, https://www.w3.org/TR/xml/#charsets."""
    code = ord(letter)
    return (
        code in (0x9, 0xA, 0xD)
        or 0x20 <= code <= 0xD7FF
        or 0xE000 <= code <= 0xFFFD
        or code >= 0x10000
    )


def test_what_is_for_markup_is_text_of_xml() -> None:
    text = for_markup(EVERY)
    assert all(map(is_xml, text))
    read = ElementTree.fromstring(f"<a>{text.replace('&', '').replace('<', '')}</a>").text
    assert read is not None
    assert for_markup("é\tθ 量 \U0001f600\n") == "é\tθ 量 \U0001f600\n"


def test_a_line_has_letters_that_are_text_of_xml() -> None:
    lines = [letter for letter in EVERY if is_line(letter)]
    assert all(map(is_xml, lines))
    assert not {"\n", "\x7f", "\x9b", "\ufdd0", "\U0010ffff"}.intersection(lines)
    assert not is_line("")


@pytest.mark.parametrize("key", ["source", "notes"])
def test_a_device_refuses_them(tmp_path: Path, key: str) -> None:
    values = json.loads(qcompile.load_device("fake_lima").to_json())
    values[key] = "a\uffff" if key == "source" else ["a\ufdd0"]
    (tmp_path / "d.json").write_text(json.dumps(values))
    with pytest.raises(qcompile.QcompileError, match="must be one line of text"):
        qcompile.load_device(tmp_path / "d.json")


def test_a_study_refuses_them(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(
        'title = "a\\uffff"\n[figures.a]\nenvironment = "CartPole-v1"\n[[figures.a.rows]]\n'
    )
    with pytest.raises(StudyError, match="title: must be one line of text"):
        read_rows(path, "s")


@pytest.mark.parametrize("text", [TURNING, "a\ufffe\x00\ud800b"])
def test_figures_pages_and_tables_hold_any_text(text: str) -> None:
    summary = {
        "policy": text,
        "backend": text,
        "episodes": [{"reward": 1.0}],
        "mean_reward": 1.0,
        "ci95": None,
    }
    page = render(
        Document("run", text, text, None, [(text, text)], [Section("A", [Facts([(text, text)])])])
    )
    table = Table([Column(text)], [[text]], text, [text])
    for kept in (
        draw_rewards(summary).svg(),
        page,
        table.markdown(),
        table.latex(),
        table._repr_html_(),
        literal(text),
    ):
        assert "evil" in kept or "b" in kept
        assert all(map(is_xml, kept))
        assert not set("\u202e\u202c\u2066\u2069\u200f").intersection(kept)
        kept.encode()
    ElementTree.fromstring(draw_rewards(summary).svg())
    assert draw_rewards(summary).png


def test_a_calibration_refuses_them() -> None:
    calibration = qcompile.calibrate("ibm_lima", [0], shots=100, seed=1, progress=False)
    values = json.loads(calibration.model_dump_json()) | {"backend": "a\uffff"}
    with pytest.raises(ValueError, match="must be one line of text"):
        Calibration.model_validate_json(json.dumps(values))
