"""Texts of a report without what is private to a machine: folders, accounts, tokens."""

from __future__ import annotations

import re
import shlex
from collections.abc import Container, Mapping, Sequence
from os import PathLike, fsdecode
from typing import Any

from qcompile.live.client_errors import without_secrets

PRIVATE = ("account", "instance", "address")
"""Options whose values name somebody or a place."""
HIDDEN = "..."
"""What a command shows instead."""
_UNSEEN = (*PRIVATE, "live", "progress", "on_note", "callback")
"""Arguments in Python that are not shown."""
_LETTERS = 80


def without_folders(path: str) -> str:
    """The name of the file or folder at a path, whose folders may name somebody."""
    return re.split(r"[/\\]", path.rstrip("/\\"))[-1] or path


def command_line(parts: Sequence[Sequence[str]]) -> str:
    """The command `qcompile` as it is typed, without tokens.

    The first part is the verb with its arguments, each other one an option with its values. A long
    command has a line for each part.
    """
    lines = [shlex.join(map(without_secrets, part)) for part in parts]
    line = " ".join(["qcompile", *lines])
    return line if len(line) <= _LETTERS else "qcompile " + " \\\n  ".join(lines)


def call(verb: str, arguments: Mapping[str, Any], paths: Container[str] = ()) -> str:
    """The call of a verb in Python with these arguments, objects by the names of their types.

    The arguments `paths` are names or paths: of a path, the name of its file is shown.
    """
    said = {name: value for name, value in arguments.items() if name not in _UNSEEN}
    words = [f"{name}={_value(value, name in paths)}" for name, value in said.items()]
    line = f"qcompile.{verb}({', '.join(words)})"
    if len(line) <= _LETTERS:
        return line
    return f"qcompile.{verb}(\n" + "".join(f"    {word},\n" for word in words) + ")"


def _value(value: Any, is_path: bool = False) -> str:
    if isinstance(value, PathLike):
        return repr(without_folders(fsdecode(value)))
    if isinstance(value, str):
        return repr(without_folders(value) if is_path else without_secrets(value))
    if value is None or isinstance(value, bool | int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_value(k)}: {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(member, is_path) for member in value) + "]"
    return f"<{type(value).__name__}>"
