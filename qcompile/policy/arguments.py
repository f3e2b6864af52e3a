"""Arguments of an environment as a policy file may give them: plain values that load no code."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

RESERVED = ("id", "render_mode", "disable_env_checker")
"""Arguments of gymnasium.make that a run sets itself."""

_WORDS = re.compile(r"[A-Za-z0-9 _-]{0,200}")


def check_arguments(arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """`arguments`, unless one could make an environment import a module or open a file.

    Some environments import what an argument names ("module:name", "module.Class") or read the file
    at a path; texts of letters, digits, spaces, - and _ cannot name either.

    Raises:
        ValueError: an argument is reserved, its name is not one of Python's, a number is not
            finite, or a text has other characters.
    """
    for name, value in arguments.items():
        if name in RESERVED or not (name.isidentifier() and name.isascii()):
            raise ValueError(f"{name[:60]!a} is not an argument that a policy file may set")
        _check_plain(name, value)
    steps = arguments.get("max_episode_steps", 1)
    if type(steps) is not int or steps < 1:
        raise ValueError("max_episode_steps is not a whole number from 1 on")
    return arguments


def _check_plain(name: str, argument: Any) -> None:
    values = [argument]
    while values:
        value = values.pop()
        if isinstance(value, dict):
            values += [*value, *value.values()]
        elif isinstance(value, list):
            values += value
        elif isinstance(value, str) and not _WORDS.fullmatch(value):
            raise ValueError(
                f"{name} has the text {value[:40]!a}: texts are of letters, digits, spaces, - and "
                "_, so that they name no module and no file"
            )
        elif isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name} has a number that is not finite")
