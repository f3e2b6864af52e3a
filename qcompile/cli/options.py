"""Options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Callable, Container
from itertools import chain
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

from qcompile.cli.assignments import EnvironmentArgument, as_mapping
from qcompile.cli.types import Integer, NamePath, Shots

if TYPE_CHECKING:
    pass

BACKEND_HELP = (
    "Device name (`qcompile backends` lists them), device file, calibration file, or qiskit:NAME "
    "for a Qiskit backend."
)

Function = TypeVar("Function", bound=Callable[..., Any])


class Decorator(Protocol):
    """The type of click.option(...): takes a function and returns it."""

    def __call__(self, function: Function, /) -> Function: ...


def check_only(allowed: Container[str], option: str, why: str) -> None:
    """Raise click.UsageError if the command line has a parameter that `option` makes useless."""
    ctx = click.get_current_context()
    for param in ctx.command.params:
        source = ctx.get_parameter_source(str(param.name))
        if param.name not in allowed and source is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{param.opts[0]} cannot be used with {option}: {why}.")


def explicit(**values: Any) -> dict[str, Any]:
    """The values, by option, that the command line or an environment variable sets."""
    source = click.get_current_context().get_parameter_source
    return {
        name: value
        for name, value in values.items()
        if source(name) is not click.core.ParameterSource.DEFAULT
    }


def once(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[Any, ...], ...]
) -> tuple[Any, ...]:
    """All values of a repeated option, without duplicates."""
    return tuple(dict.fromkeys(chain.from_iterable(values)))


def backend_option(default: str = "ideal") -> Decorator:
    return click.option(
        "--backend",
        type=NamePath(),
        default=default,
        show_default=True,
        metavar="NAME",
        help=BACKEND_HELP,
    )


def engine_options(noun: str) -> Callable[[Function], Function]:
    """The options --engine, --address and --workers; `noun` names what they run in parallel."""
    options = (
        click.option(
            "--engine",
            type=click.Choice(["processes", "dask", "ray"]),
            default="processes",
            show_default=True,
            help=f"How to run {noun} in parallel.",
        ),
        click.option(
            "--address",
            help="Address of a running Dask scheduler or Ray cluster.  [default: start one here]",
        ),
        click.option(
            "--workers",
            type=Integer(1),
            help=f"{noun.capitalize()} to run at a time.  [default: one per core]",
        ),
    )

    def decorate(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


level_option: Decorator = click.option(
    "--level",
    type=Integer(0, 2),
    default=2,
    show_default=True,
    help="How far to compile. 0: translate gate by gate; 1: keep only the unitary; 2: keep only "
    "the distribution of the measurement.",
)
calibration_shots_option: Decorator = click.option(
    "--calibration-shots",
    type=Shots("auto", "auto"),
    default=8192,
    help="Shots of each circuit of the calibration that is measured first. auto: as many as "
    "--shots needs.  [default: 8192; with --live auto]",
)
split_option: Decorator = click.option(
    "--split",
    is_flag=True,
    help="Measure each decision on all copies at once, with a share of the shots on each.",
)
max_steps_option: Decorator = click.option(
    "--max-steps",
    type=Integer(1, 1_000_000),
    metavar="N",
    help="Stop each episode after N environment steps.  [default: play to the end]",
)
import_option: Decorator = click.option(
    "--import",
    "imports",
    type=NamePath(),
    multiple=True,
    metavar="MODULE",
    help="Import a Python module or FILE.py that registers environments; repeatable. This runs "
    "its code.",
)
env_option: Decorator = click.option(
    "--env",
    type=EnvironmentArgument(),
    multiple=True,
    callback=as_mapping,
    metavar="NAME=VALUE",
    help="Argument of the environment, such as is_slippery=false or map_name=8x8; repeatable. "
    "VALUE is JSON, or else plain text.",
)
json_option: Decorator = click.option(
    "--json", "as_json", is_flag=True, help="Print the result as one JSON document."
)


def echo_json(values: Any) -> None:
    """Print `values` as the JSON document of a command."""
    click.echo(json.dumps(values, indent=1, allow_nan=False))


def echo_note(words: str) -> None:
    """Print a note on standard error, apart from the result of a command."""
    click.echo(words, err=True)
