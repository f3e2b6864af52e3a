"""Pages that are typed along, in one folder each: their commands answer what the page prints.

Blocks `console` are typed, `cat` among them, and blocks `py` run; a block `text` right after one of
Python is what that prints. A block whose first line is a comment with a file's name is that file,
and a policy in JSON the file of its name.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden_files import REWRITES
from sessions import DOCS, WIDTH, Transcript, blocks, matches, typed, words_of

from qcompile.policy import Policy, load_policy

PAGES = (
    "start/getting-started.md",
    "howto/paper-figure.md",
    "howto/entangling.md",
    "howto/late-binding.md",
)
PICTURES = {
    "howto/paper-figure.md": {"paper-figure.svg": "devices.svg", "paper-shots.svg": "shots.svg"},
    "howto/entangling.md": {"device-map.svg": "map.svg"},
}
"""The pictures of a page, and the files of its commands that they are."""
POLICIES = Path(__file__).parent / "pages"
"""The policies that pages train, as they came out where the pages were written."""
FILE = re.compile(r"# ([\w-]+\.\w+)\n")
WORDS = re.compile(r"<text style=\"([^\"]*)\"[^>]*>(.*?)</text>")
"""Fonts and words of a picture; where they stand is matplotlib's."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    return tmp_path


def take_shown_policy(out: Path) -> None:
    """Replace a policy that was just trained by the one that the page shows.

    Processors round differently, and after thousands of updates a policy has other digits.
    """
    trained, shown = load_policy(out), load_policy(POLICIES / out.name)
    assert isinstance(trained, Policy)
    assert isinstance(shown, Policy)
    np.testing.assert_allclose(trained.theta, shown.theta, atol=0.3)
    shutil.copy(POLICIES / out.name, out)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_prints_what_its_commands_answer(
    page: str, folder: Path, qcompile: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    transcript, printed = Transcript(page, folder), None
    names = {"__name__": "__main__"}
    for language, block in blocks(page):
        if named := FILE.match(block):
            Path(named[1]).write_text(block)
        elif language == "json":
            Path(f"{json.loads(block)['name']}.json").write_text(block)
        elif language == "console":
            for line, expected in typed(block):
                name, *words = words_of(line)
                if name == "cat":
                    now = Path(*words).read_text()
                else:
                    assert name == "qcompile", line
                    answer = qcompile(*words)
                    assert answer.code == 0, answer.err
                    now = answer.out + answer.err
                    if words[0] == "train":
                        take_shown_policy(Path(words[words.index("--out") + 1]))
                transcript.compare(line, expected, now)
        elif language == "py":
            exec(compile(block, page, "exec"), names)
            printed = capsys.readouterr().out
        elif language == "text" and printed is not None:
            assert matches(block, printed), printed
            printed = None
    transcript.check()
    for picture, name in PICTURES.get(page, {}).items():
        drawn, shown = Path(name).read_text(), DOCS / "images" / picture
        if REWRITES:
            shown.write_text(drawn)
        assert WORDS.findall(drawn) == WORDS.findall(shown.read_text()), picture


def test_the_readme_shows_the_first_run_as_the_page_does() -> None:
    page = blocks("start/getting-started.md")
    _, first = next(typed(next(block for language, block in page if language == "console")))
    assert f"```\n{first}```\n" in (DOCS.parent / "README.md").read_text()


def test_a_command_goes_on_after_a_backslash() -> None:
    block = "$ qcompile run cartpole \\\n    --shots 32\nan answer\n$ cat a.md\n"
    (first, answer), (second, nothing) = typed(block)
    assert words_of(first) == ["qcompile", "run", "cartpole", "--shots", "32"]
    assert words_of(second) == ["cat", "a.md"]
    assert (answer, nothing) == ("an answer\n", "")


def test_another_answer_would_be_noticed() -> None:
    assert matches("a\n...\nd\n", "a\nb\nc\nd\n")
    assert matches("a\n...\n", "a\n")
    assert not matches("a\n...\nd\n", "a\nb\nc\n")
    assert not matches("mean 500.0\n", "mean 499.0\n")
