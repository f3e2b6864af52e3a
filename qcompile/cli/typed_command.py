"""The command that was typed, as a page shows it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import click

from qcompile.cli.types import NamePath, Several


def typed_command() -> str:
    """The command line of the current command, one option per line where it is long."""
    from qcompile.page.words import command_line

    return command_line(_parts(click.get_current_context(), sys.argv[1:]))


def _parts(ctx: click.Context, words: Sequence[str]) -> list[list[str]]:
    """The command that was typed: the verb with its arguments, and each option with its value.

    Of paths, the names of the files are shown, and of private options that they were there.
    """
    from qcompile.page.words import without_folders

    options = {
        name: param
        for param in ctx.command.params
        if isinstance(param, click.Option)
        for name in (*param.opts, *param.secondary_opts)
    }
    parts: list[list[str]] = [[]]
    rest, only_arguments = iter(words), False
    for word in rest:
        name, joined, value = word.partition("=")
        option = None if only_arguments else options.get(name)
        only_arguments = only_arguments or word == "--"
        if option is None:
            parts[-1].append(without_folders(word))
        elif joined:
            parts.append([f"{name}={_value(option, value)}"])
        else:
            parts.append([name] if option.is_flag else [name, _value(option, next(rest))])
    return parts


def _value(option: click.Option, value: str) -> str:
    """The value of an option as a page shows it."""
    from qcompile.page.words import HIDDEN, PRIVATE, without_folders

    if option.name in PRIVATE:
        return HIDDEN
    kind: click.ParamType[Any] = option.type
    if isinstance(kind, Several) and isinstance(kind.inner, click.Path | NamePath):
        return ",".join(map(without_folders, value.split(",")))
    return without_folders(value) if isinstance(kind, click.Path | NamePath) else value
