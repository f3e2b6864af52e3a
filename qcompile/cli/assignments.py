"""Options of the form NAME=VALUE."""

from __future__ import annotations

import json
from typing import Any, Literal, get_args, get_origin, get_type_hints

import click


class Assignment(click.ParamType[tuple[str, Any]]):
    """The name and value of a training setting, as `qcompile.train` takes them.

    "none" is None if the setting may be None; a setting of several values takes a JSON list or
    values separated by commas. Any other value stays text, which the settings parse.
    """

    name = "NAME=VALUE"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, Any]:
        from qcompile.rl.settings import Settings

        name, sign, text = (part.strip() for part in str(value).partition("="))
        if not sign:
            self.fail(f"{value!r} must be NAME=VALUE, such as clip=0.2.", param, ctx)
        hint = get_type_hints(Settings).get(name)
        kinds = {get_origin(kind) or kind for kind in (hint, *get_args(hint))}
        if text == "none" and type(None) in kinds:
            return name, None
        may_be_one = Literal in kinds and "," not in text
        if tuple not in kinds or may_be_one:
            return name, text
        if not text.startswith("["):
            return name, [part.strip() for part in text.split(",")]
        try:
            return name, json.loads(text)
        except ValueError as error:
            self.fail(f"{name}={text} is not a JSON list: {error}.", param, ctx)


class EnvironmentArgument(click.ParamType[tuple[str, Any]]):
    """The name and value of an environment argument; the value is JSON, or else plain text."""

    name = "NAME=VALUE"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, Any]:
        name, sign, text = (part.strip() for part in str(value).partition("="))
        if not sign or not name.isidentifier():
            self.fail(f"{value!r} must be NAME=VALUE, such as is_slippery=false.", param, ctx)
        try:
            return name, json.loads(text, parse_constant=str)
        except (ValueError, RecursionError):
            return name, text


def as_mapping(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, Any], ...]
) -> dict[str, Any]:
    """The values of a repeated option by name.

    Raises:
        click.BadParameter: a name is set twice.
    """
    names = [name for name, _ in values]
    for name in names:
        if names.count(name) > 1:
            raise click.BadParameter(f"{name!r} is set twice.", ctx, param)
    return dict(values)
