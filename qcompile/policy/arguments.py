"""Arguments of an environment: those that a user names, and what a policy file may give.

A policy file is another's word: its arguments load no code. A user's own are plain values.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from qcompile.errors import OptionError
from qcompile.policy.policy import Policy

RESERVED = ("id", "render_mode", "disable_env_checker")
"""Arguments of gymnasium.make that a run sets itself."""

_WORDS = re.compile(r"[A-Za-z0-9 _-]{0,200}")


def with_arguments(policy: Policy, env: Mapping[str, Any] | None, *, kept: bool = False) -> Policy:
    """The policy, whose environment is made with `env` over the arguments that it has.

    Raises:
        OptionError: an argument is reserved or not a plain value, or `kept`, and a policy file
            could not keep it.
    """
    if not env:
        return policy
    check_env(env, kept=kept)
    return replace(policy, environment_kwargs={**policy.environment_kwargs, **env})


def check_env(env: Mapping[str, Any], *, kept: bool = False) -> None:
    """Raise OptionError where a user's arguments are reserved, or not plain values.

    With `kept` they must be such as a policy file may give, too.
    """
    for name, value in env.items():
        if name in RESERVED or not name.isidentifier():
            raise OptionError(
                f"env {name[:60]}: that is not an argument of an environment.",
                f"Those of gymnasium.make itself ({', '.join(RESERVED)}) are set by a run.",
            )
        try:
            plain = json.loads(json.dumps(value, allow_nan=False)) == value
        except (TypeError, ValueError, RecursionError):
            plain = False
        if not plain:
            raise OptionError(
                f"env {name} is {value!r:.60}.",
                "An argument is a number, a text, true, false, null, or a list or dict of these; "
                "gymnasium.register gives an environment any other.",
            )
    if kept:
        try:
            check_arguments(env)
        except ValueError as error:
            raise OptionError(
                f"env cannot be kept in a policy file: {error}.",
                "Register the environment with it, in a module of yours: --import MODULE.",
            ) from error


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
