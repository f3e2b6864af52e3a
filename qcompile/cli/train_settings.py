"""What `qcompile train` is told to train: settings from options, or from a checkpoint."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

import click
from click.core import ParameterSource

if TYPE_CHECKING:
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.settings import Settings

NOISY_SHOTS = 1024
"""Shots on a backend with noise where none are named."""

_PRESET_OF = ("model", "layout")
_FROM_CHECKPOINT = (
    "preset",
    "layout",
    "reuse",
    "episodes",
    "steps",
    "assignments",
    "backend",
    "shots",
    "mitigation",
)


def given(ctx: click.Context, name: str) -> bool:
    """Whether the option was named on the command line."""
    return ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE


def _flag(ctx: click.Context, name: str) -> str:
    """How the option is written, as in --reuse."""
    return next(p.opts[-1] for p in ctx.command.params if p.name == name)


def chosen_settings(ctx: click.Context) -> Settings:
    """The preset's settings with what the options change.

    Raises:
        click.BadParameter: an assignment of --set is none, or contradicts an option.
        QcompileError: the settings do not fit each other, or there is no such device.
    """
    from qcompile.device import IDEAL_NAME, load_device
    from qcompile.rl.presets import settings_for

    options = ctx.params
    settings = settings_for(
        options["preset"], options["environment"], options["model"], options["layout"]
    )
    changed = _assigned(ctx)
    if options["episodes"] is not None or options["steps"] is not None:
        changed = {"episodes": options["episodes"], "steps": options["steps"]} | changed
    if given(ctx, "backend"):
        noisy = not load_device(options["backend"]).is_ideal
        changed["backend"] = options["backend"] if noisy else IDEAL_NAME
        if noisy:
            changed = {"shots": NOISY_SHOTS, "mitigation": "readout"} | changed
    for name in ("reuse", "shots", "mitigation"):
        if given(ctx, name):
            changed[name] = options[name]
    return settings.changed(**changed)


def _assigned(ctx: click.Context) -> dict[str, Any]:
    """What --set assigns: values for `Settings.changed`, which checks them.

    Raises:
        click.BadParameter: a text that assigns nothing, or contradicts another or an option.
    """
    from qcompile.catalogue import nearest
    from qcompile.rl.settings import SETTING_NAMES, Settings

    hints = get_type_hints(Settings)
    values: dict[str, Any] = {}
    for text in ctx.params["assignments"]:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign:
            raise _bad(f"{text!r} is no NAME=VALUE, such as clip=0.2.")
        if name not in SETTING_NAMES:
            raise _bad(f"Unknown setting {name!r}. {nearest(name, SETTING_NAMES)}")
        if name in _PRESET_OF:
            raise _bad(f"{name!r} decides which preset is taken; use --{name}.")
        if name in values:
            raise _bad(f"{name!r} is set twice.")
        if name in ctx.params and given(ctx, name):
            raise _bad(f"{name!r} is set by --{name} too.")
        values[name] = _value(name, value, hints[name])
    return values


def _value(name: str, text: str, hint: Any) -> Any:
    """The text as `none`, as a list where the setting has several values, or as it is."""
    if text == "none" and type(None) in get_args(hint):
        return None
    if get_origin(hint) is not tuple:
        return text
    if not text.startswith("["):
        return [part.strip() for part in text.split(",")]
    try:
        return json.loads(text)
    except ValueError as error:
        raise _bad(f"{name}={text} is no JSON list: {error}.") from error


def _bad(message: str) -> click.BadParameter:
    return click.BadParameter(message, param_hint="'-s' / '--set'")


def _refuse_changes(ctx: click.Context) -> None:
    """Raise click.UsageError where an option would change settings beside --resume."""
    named = [_flag(ctx, name) for name in _FROM_CHECKPOINT if given(ctx, name)]
    if named:
        raise click.UsageError(
            f"{' and '.join(named)} cannot be given with --resume: "
            "settings come from the checkpoint."
        )


def resumed(ctx: click.Context, path: Path) -> Trainer:
    """The trainer of a checkpoint; what was named besides must agree with it.

    Raises:
        click.UsageError: an option would change settings.
        TrainingError: it is no checkpoint, or of another environment, model or seed.
    """
    from qcompile.errors import TrainingError
    from qcompile.rl.checkpoint import load_checkpoint

    _refuse_changes(ctx)
    trainer, differ = load_checkpoint(path)
    made = {
        "environment": trainer.environment,
        "model": trainer.settings.model,
        "seed": trainer.seed,
    }
    for name, value in made.items():
        if given(ctx, name) and ctx.params[name] != value:
            raise TrainingError(
                f"Checkpoint {path} has the {name} {value!r}, found {ctx.params[name]!r}.",
                f"Name {value}, or resume another checkpoint.",
            )
    if differ:
        click.echo(
            f"Warning: {path} was made with other versions ({'; '.join(differ)}). "
            "The training may not go on bit for bit.",
            err=True,
        )
    return trainer
