"""Texts of a report without what is private to a machine: folders, accounts, tokens."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import PurePath
from typing import Any

from qcompile.live.client_errors import without_secrets

_FOLDERS = re.compile(
    r"""(?:(?<=^)|(?<=[\s=,:"'(\[]))  # where a path may begin
    (?:~[\w.-]*|(?:\.\./)*\.\.|[A-Za-z]:)?[/\\]{1,2}
    (?:[^/\\,"'\s][^/\\,"'\n]*[/\\])+""",
    re.VERBOSE,
)
_HOME = re.compile(r"""(?<![\w/\\.])(?:~[\w.-]*|(?:\.\.[/\\])*\.\.)[/\\](?=[^/\\])""")
_PRIVATE = ("--account", "--instance", "--address")
"""Options of the command line whose values name somebody or a place."""
_UNSEEN = ("account", "instance", "address", "live", "progress", "on_note", "callback")
"""Arguments in Python that are not shown."""
_HIDDEN = "..."
_LETTERS = 80


def without_folders(text: str) -> str:
    """The text with every absolute path, and every one from a home or upwards, cut to its name."""
    return _HOME.sub("", _FOLDERS.sub("", text))


def public(text: str) -> str:
    """The text as a report shows it: without folders and tokens."""
    return without_folders(without_secrets(text))


def command_line(words: Sequence[str]) -> str:
    """The command `qcompile` with these words, as it is typed, without what is private.

    A long one has a line for each option.
    """
    shown, hides = ["qcompile"], False
    for word in words:
        option, is_joined, _ = word.partition("=")
        if hides:
            shown.append(_HIDDEN)
        elif option in _PRIVATE and is_joined:
            shown.append(f"{option}={_HIDDEN}")
        else:
            shown.append(public(word))
        hides = not hides and word in _PRIVATE
    line = shlex.join(shown)
    return line if len(line) <= _LETTERS else re.sub(r" (?=--\w)", " \\\n  ", line)


def call(verb: str, arguments: Mapping[str, Any]) -> str:
    """The call of a verb in Python with these arguments, objects by the names of their types."""
    said = {name: value for name, value in arguments.items() if name not in _UNSEEN}
    words = [f"{name}={_value(value)}" for name, value in said.items()]
    line = f"qcompile.{verb}({', '.join(words)})"
    if len(line) <= _LETTERS:
        return line
    return f"qcompile.{verb}(\n" + "".join(f"    {word},\n" for word in words) + ")"


def _value(value: Any) -> str:
    if isinstance(value, PathLike):
        return repr(PurePath(value).name)
    if isinstance(value, str):
        return repr(public(value))
    if value is None or isinstance(value, bool | int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_value(k)}: {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return f"<{type(value).__name__}>"
