"""Pages: escaped, whole, without scripts, and silent on who made them."""

from __future__ import annotations

import getpass
import platform
import re
from collections.abc import Callable
from datetime import UTC, datetime
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy
import pytest

import qcompile
from qcompile.errors import OptionError, OutputError
from qcompile.page.document import Document, Facts, Score, Section, Table
from qcompile.page.render import render

HOSTILE = '"><img src=x onerror=alert(1)>'


def document(**changes: object) -> Document:
    values: dict[str, object] = {
        "kind": "run",
        "title": HOSTILE,
        "lead": HOSTILE,
        "score": Score(HOSTILE, HOSTILE, HOSTILE, HOSTILE),
        "facts": [(HOSTILE, HOSTILE)],
        "sections": [
            Section("Results", [Table(HOSTILE, [HOSTILE], [[HOSTILE]], HOSTILE)]),
            Section("Settings", [Facts([(HOSTILE, HOSTILE)])]),
            Section("Empty", []),
        ],
        "warnings": [HOSTILE],
        "command": HOSTILE,
    }
    return Document(**(values | changes))  # type: ignore[arg-type]


class Tags(HTMLParser):
    """The tags of a page and their attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def test_every_text_is_escaped() -> None:
    page = render(document())
    tags = Tags(page).tags
    assert "img" not in {tag for tag, _ in tags}
    assert not [name for _, attributes in tags for name in attributes if name.startswith("on")]
    times = {
        "title": 2,
        "lead": 1,
        "score": 4,
        "facts": 2 + 2,
        "table": 4,
        "warning": 1,
        "command": 1,
    }
    assert page.count("onerror=alert(1)&gt;") == sum(times.values())


def test_a_page_forbids_scripts_and_requests() -> None:
    tags = Tags(render(document())).tags
    policy = next(a["content"] for tag, a in tags if "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert "script" not in policy
    assert not [tag for tag, _ in tags if tag in ("script", "iframe", "object", "form")]


def test_a_section_without_blocks_is_left_out() -> None:
    page = render(document())
    assert re.findall(r"<h2 id=\"([^\"]+)\"", page) == ["results", "settings", "how-it-was-made"]


def test_a_page_names_versions_and_when_it_was_made() -> None:
    page = render(document(), datetime(2026, 3, 4, 5, 6, tzinfo=UTC))
    assert "4 March 2026, 05:06 UTC" in page
    for name, version in {
        "qcompile": qcompile.__version__,
        "Python": platform.python_version(),
        "numpy": numpy.__version__,
    }.items():
        assert f"<dt>{name}</dt><dd>{version}</dd>" in page


def test_numbers_stand_on_the_right() -> None:
    rows = [["ibm_lima", "1,024", "-1.5 ± 0.3", "+0.0", "2 of 3"], ["ideal", "8", "20.0", "-", "-"]]
    assert Table("t", ["a"] * 5, rows).numeric == [False, True, True, True, False]


@pytest.mark.parametrize("kind", ["run", "calibrate", "plan"])
def test_a_report_does_not_tell_where_or_by_whom_it_was_made(
    kind: str, report: Callable[[str], Path]
) -> None:
    path = report(kind)
    page = re.sub(r"base64,[\w+/=]+", "", path.read_text())
    assert str(path.parent) not in page
    assert str(Path(__file__).parents[2]) not in page
    assert str(Path.home()) + "/" not in page
    if getpass.getuser() != "root":
        assert getpass.getuser() not in page


def test_a_report_of_a_run_tells_its_score(report: Callable[[str], Path]) -> None:
    """The numbers of a run that the same seed repeats."""
    page = report("run").read_text()
    assert "lowest to highest reward" in page
    assert page.count("<video") == 1
    assert "policy=&lt;Policy&gt;" in page
    for title in ("Film", "Episodes", "Circuits", "Placement", "Budget", "Settings"):
        assert f">{title}</h2>" in page


def test_a_report_is_refused_where_it_cannot_be_written(tmp_path: Path) -> None:
    calibration = qcompile.calibrate("ibm_lima", [0], shots=100, seed=1, progress=False)
    with pytest.raises(OptionError, match=r"must end with \.html"):
        calibration.report(tmp_path / "a.pdf")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="Cannot write"):
        calibration.report(tmp_path / "file" / "a.html")
    calibration.report(tmp_path / "a.html")
    assert [path.name for path in tmp_path.iterdir() if path.name != "file"] == ["a.html"]


@pytest.mark.parametrize(
    "text",
    [
        "see https://arxiv.org/abs/2203.14348 & more",
        "https://github.com/foo/bar and ~/x ratio a/b /c/d <b>bold</b>",
        "ends with ^~\\{}",
        "/home/ada/x and C:\\Users\\ada",
    ],
)
def test_texts_are_shown_as_they_are(text: str) -> None:
    """Only what is known to be a path loses its folders, and not here."""
    page = unescape(render(document(title=text, lead=text, warnings=[text])))
    assert page.count(text) == 2 + 1 + 1
