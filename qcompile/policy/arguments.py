"""Arguments of an environment: those that a user names, and what a policy file may give.

A policy file is another's word: its arguments load no code. A user's own are plain values.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from qcompile.caller import option
from qcompile.errors import OptionError
from qcompile.policy.network import Network
from qcompile.policy.policy import Policy

P = TypeVar("P", bound=Policy | Network)

RESERVED = ("id", "render_mode", "disable_env_checker")
"""Arguments of gymnasium.make that a run sets itself."""

_WORDS = re.compile(r"[A-Za-z0-9 _-]{0,200}")


def with_arguments(policy: P, env: Mapping[str, Any] | None, *, for_file: bool = False) -> P:
    """The policy with `env` merged over its environment's arguments.

    Raises:
        OptionError: an argument is reserved, not a plain value, or with `for_file` not allowed
            there.
    """
    if not env:
        return policy
    check_env(env, for_file=for_file)
    return replace(policy, environment_kwargs={**policy.environment_kwargs, **env})


def check_env(env: Mapping[str, Any], *, for_file: bool = False) -> None:
    """Raise OptionError if a user's arguments are reserved or not plain values.

    With `for_file` they must also be allowed in a policy file.
    """
    for name, value in env.items():
        if name in RESERVED or not name.isidentifier():
            raise OptionError(
                f"{option('env')} {name[:60]}: this is not an argument of an environment.",
                f"The arguments of gymnasium.make itself ({', '.join(RESERVED)}) are set by a run.",
            )
        try:
            plain = json.loads(json.dumps(value, allow_nan=False)) == value
        except (TypeError, ValueError, RecursionError):
            plain = False
        if not plain:
            raise OptionError(
                f"{option('env')} {name} is {value!r:.60}.",
                "An argument is a number, a string, true, false, null, or a list or dict of these; "
                "use gymnasium.register for any other.",
            )
    if for_file:
        try:
            check_arguments(env)
        except ValueError as error:
            raise OptionError(
                f"{option('env')} cannot be stored in a policy file: {error}.",
                "Register the environment with it in a module of your own: "
                f"{option('imports')} MODULE.",
            ) from error


def check_arguments(arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """The `arguments`, checked not to make an environment import a module or open a file.

    Some environments import what an argument names ("module:name", "module.Class") or read the file
    at a path; strings of letters, digits, spaces, - and _ cannot name either.

    Raises:
        ValueError: an argument is reserved, its name is not a Python identifier, a number is not
            finite, or a string has other characters.
    """
    for name, value in arguments.items():
        if name in RESERVED or not (name.isidentifier() and name.isascii()):
            raise ValueError(f"{name[:60]!a} is not an argument that a policy file may set")
        _check_plain(name, value)
    steps = arguments.get("max_episode_steps", 1)
    if type(steps) is not int or steps < 1:
        raise ValueError("max_episode_steps is not a whole number of at least 1")
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
                f"{name} has the string {value[:40]!a}: strings may have letters, digits, "
                "spaces, - "
                "and _, so that they cannot name a module or a file"
            )
        elif isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name} has a number that is not finite")
