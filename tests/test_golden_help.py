"""The help page of every command, as it is shown: tests/golden/help."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import click
import pytest
from golden_files import WIDTH, check, check_names

from qcompile.cli.group import cli


def every_command(
    group: click.Group = cli, words: tuple[str, ...] = ()
) -> Iterator[tuple[str, ...]]:
    """The words of each command and subcommand, the group's own first."""
    yield words
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from every_command(command, (*words, name))
        else:
            yield (*words, name)


PAGES = {"-".join(("qcompile", *words)): words for words in every_command()}


@pytest.mark.parametrize("page", PAGES)
def test_help(page: str, qcompile: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    answer = qcompile(*PAGES[page], "--help")
    assert (answer.code, answer.err) == (0, "")
    check(f"help/{page}", answer.out)


def test_every_page_has_its_command() -> None:
    check_names("help", PAGES)
