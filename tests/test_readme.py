"""The README and the documentation say what is so: code runs, commands and files are there."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import click
import pytest
from sessions import words_of
from standin import StandIn
from trackers import trackers

from qcompile.cli.group import cli

CHECKOUT = Path(__file__).parents[1]
PAGES = sorted(
    path
    for pattern in ("*.md", "docs/**/*.md", "hardware/*.md", "trained/*.md")
    for path in CHECKOUT.glob(pattern)
)

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_COMMAND = re.compile(r"(?:^|`)(qcompile (?:[^`#\n|\\]|\\\n)*)", re.MULTILINE)


def blocks(page: Path, language: str) -> list[str]:
    return [text for found, text in _FENCE.findall(page.read_text()) if found == language]


def name(page: Path) -> str:
    return str(page.relative_to(CHECKOUT))


def python_blocks() -> list[tuple[str, str]]:
    return [(name(page), text) for page in PAGES for text in blocks(page, "python")]


@pytest.mark.filterwarnings("ignore:builtin type .*has no __module__:DeprecationWarning")  # Box2D's
@pytest.mark.parametrize(("page", "text"), python_blocks(), ids=lambda value: value[:20])
def test_python_blocks_run_as_they_stand(
    page: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block that asks for an account of IBM's gets the stand-in of the service."""
    monkeypatch.chdir(tmp_path)
    for tracker, module in trackers().items():
        monkeypatch.setitem(sys.modules, tracker, module)
    with (
        StandIn({"ibm_fez": "FakeFez"})
        if "QiskitRuntimeService" in text
        else nullcontext() as service
    ):
        if service is not None:
            for variable, value in service.environment().items():
                monkeypatch.setenv(variable, value)
        exec(compile(text, page, "exec"), {"__name__": "__main__"})


def test_the_readme_has_a_python_block() -> None:
    assert "README.md" in [page for page, _ in python_blocks()]


def commands() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for found in _COMMAND.findall(page.read_text()):
            yield name(page), found.strip()


def check_command(line: str) -> None:
    """Fail where a command, an argument or an option in `line` is not of the command line."""
    words = [word for word in words_of(line)[1:] if word not in ("...", "COMMAND")]
    command: click.Command = cli
    context = click.Context(cli, info_name="qcompile", **cli.context_settings)
    while words and isinstance(command, click.Group):
        if words[0].startswith("-"):
            assert words.pop(0) in {o for p in command.get_params(context) for o in p.opts}
            continue
        if command.get_command(context, words[0]) is None:
            assert command.invoke_without_command, f"{line}: there is no command {words[0]}"
            return
        below = command.get_command(context, words.pop(0))
        assert below is not None
        command, context = below, click.Context(below, parent=context, info_name=below.name)
    known = {o for p in command.get_params(context) for o in (*p.opts, *p.secondary_opts)}
    assert {word for word in words if word.startswith("-")} <= known, line
    if not words or any(word.isupper() or word == "--help" for word in words):
        return  # the name alone, or with a placeholder, such as --out DIR
    context = command.make_context(command.name, words, parent=context.parent)
    context.close()


@pytest.mark.parametrize(("page", "line"), [*dict.fromkeys(commands())])
def test_commands_are_there(page: str, line: str) -> None:
    check_command(line)


@pytest.mark.parametrize(
    "line", ["qcompile nosuch", "qcompile run --nosuch", "qcompile run a b", "qcompile train x"]
)
def test_commands_that_are_not_there_would_be_noticed(line: str) -> None:
    with pytest.raises((AssertionError, click.UsageError)):
        check_command(line)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_pages_are_filled(page: Path) -> None:
    text = page.read_text()
    assert text.strip()
    assert "@@" not in text, "a place to be filled is left"


def test_the_pages_are_those_a_reader_looks_for() -> None:
    wanted = {"README.md", "CHANGELOG.md", "trained/README.md", "hardware/README.md"}
    assert wanted <= {name(page) for page in PAGES}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_to_files(page: Path) -> None:
    prose = _FENCE.sub("", page.read_text())
    links = [link for link in _LINK.findall(prose) if "://" not in link and link[0] != "#"]
    broken = [link for link in links if not (page.parent / link.partition("#")[0]).exists()]
    assert not broken
