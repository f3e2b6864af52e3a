"""Options that several commands share."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

from qcompile.cli.assignments import EnvironmentArgument, as_mapping
from qcompile.limits import MAX_SHOTS, MOST_AHEAD

if TYPE_CHECKING:
    from qcompile.mitigation.measure import Part

BACKEND_HELP = (
    "Device by name or file (`qcompile backends` lists them), calibration file, or qiskit:NAME."
)

Function = TypeVar("Function", bound=Callable[..., Any])


class Decorator(Protocol):
    """What click.option gives: a function in, the same function out."""

    def __call__(self, function: Function, /) -> Function: ...


class Shots(click.ParamType[int | str | None]):
    """A number of shots, or a word, which means `meaning`.

    "exact" asks for expectations without shot noise.
    """

    def __init__(self, word: str = "exact", meaning: str | None = None):
        self.name = f"n|{word}"
        self._word, self._meaning = word, meaning

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str | None:
        if value is None or isinstance(value, int):
            return value
        if value == self._word:
            return self._meaning
        try:
            shots = int(value)
        except ValueError:
            self.fail(f"{value!r} is neither a number nor '{self._word}'.", param, ctx)
        if not 1 <= shots <= MAX_SHOTS:
            self.fail(
                f"{shots} shots cannot be run; the number lies in [1, {MAX_SHOTS}] "
                f"(1024 and 8192 are usual), or say '{self._word}'.",
                param,
                ctx,
            )
        return shots


class Depth(click.ParamType["int | str"]):
    """A number of decisions that a job measures of an episode, or "auto"."""

    name = "d|auto"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        if value == "auto":
            return "auto"
        if not str(value).isdecimal() or not 1 <= int(value) <= MOST_AHEAD:
            self.fail(f"{value} is neither a number from 1 to {MOST_AHEAD} nor 'auto'.", param, ctx)
        return int(value)


class Share(click.FloatRange):
    """A number above 0 and at most 1, or below 1 where `open_end`."""

    def __init__(self, *, open_end: bool = False) -> None:
        super().__init__(0, 1, min_open=True, max_open=open_end)

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number: float = super().convert(value, param, ctx)
        if math.isnan(number):  # compares with no end of the range
            self.fail(f"{value!r} is not a number.", param, ctx)
        return number


class Positive(click.FloatRange):
    """A positive number of a unit, infinitely many among them where `most` is None."""

    def __init__(self, unit: str, *, zero: bool = False, most: float | None = None) -> None:
        super().__init__(0, most, min_open=not zero)
        self._unit = unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number: float = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not a number of {self._unit}.", param, ctx)
        return number


class Qubits(click.ParamType[tuple[int, ...]]):
    """Numbers of qubits with commas between them, sorted, each once."""

    name = "0,1,5"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        parts = [part.strip() for part in str(value).split(",")]
        if not all(part.isdecimal() and len(part) < 7 for part in parts):
            self.fail(f"{value!r} is not a list of qubits such as 0,1,5.", param, ctx)
        return tuple(sorted({int(part) for part in parts}))


class Parts(click.ParamType["tuple[Part, ...]"]):
    """What of a device to measure, with commas between."""

    name = "readout,response"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Part, ...]:
        from qcompile.mitigation.measure import PARTS

        named = [part.strip() for part in str(value).split(",")]
        for part in named:
            if part not in PARTS:
                self.fail(f"{part!r} is neither readout nor response.", param, ctx)
        return tuple(part for part in PARTS if part in named)


class MarkdownPath(click.Path):
    """Where a Markdown page is written."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.suffix != ".md":
            self.fail(f"{path} must end with .md.", param, ctx)
        return path


class Several(click.ParamType[tuple[Any, ...]]):
    """Values of another type, set apart by commas."""

    def __init__(self, inner: click.ParamType[Any]):
        self.inner, self.name = inner, inner.name

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Any, ...]:
        parts = [part.strip() for part in str(value).split(",")]
        if not all(parts):
            self.fail(f"{value!r} has nothing before or after a comma.", param, ctx)
        return tuple(self.inner.convert(part, param, ctx) for part in parts)


def said(**values: Any) -> dict[str, Any]:
    """Those of the values, by option, that the command line or a variable has said."""
    source = click.get_current_context().get_parameter_source
    return {
        name: value
        for name, value in values.items()
        if source(name) is not click.core.ParameterSource.DEFAULT
    }


def once(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[Any, ...], ...]
) -> tuple[Any, ...]:
    """All values of a repeated option, each once."""
    return tuple(dict.fromkeys(chain.from_iterable(values)))


def backend_option(default: str = "ideal") -> Decorator:
    return click.option(
        "--backend",
        default=default,
        show_default=True,
        metavar="NAME",
        help=BACKEND_HELP,
    )


def engine_options(noun: str) -> Callable[[Function], Function]:
    """The options --engine, --address and --workers; `noun` is what is run side by side."""
    options = (
        click.option(
            "--engine",
            type=click.Choice(["processes", "dask", "ray"]),
            default="processes",
            show_default=True,
            help=f"What runs the {noun} side by side.",
        ),
        click.option("--address", help="Address of a running Dask scheduler or Ray cluster."),
        click.option(
            "--workers",
            type=click.IntRange(1),
            help=f"{noun.capitalize()} at a time.  [default: one for each core]",
        ),
    )

    def decorate(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


level_option: Decorator = click.option(
    "--level",
    type=click.IntRange(0, 2),
    default=2,
    show_default=True,
    help="0: gate by gate; 1: keep the unitary; 2: keep the distribution of the measurement.",
)
calibration_shots_option: Decorator = click.option(
    "--calibration-shots",
    type=Shots("auto", "auto"),
    default=8192,
    help="Shots of the calibration that is measured first. auto: few where --shots are few. "
    " [default: 8192; with --live auto]",
)
split_option: Decorator = click.option(
    "--split",
    is_flag=True,
    help="Measure each decision in all copies, with a share of the shots in each.",
)
max_steps_option: Decorator = click.option(
    "--max-steps",
    type=click.IntRange(1, 1_000_000),
    help="Stop each episode after N environment steps.  [default: play them to their end]",
)
import_option: Decorator = click.option(
    "--import",
    "imports",
    multiple=True,
    metavar="MODULE",
    help="Import a module, or FILE.py, that registers environments; repeatable. Its code runs.",
)
env_option: Decorator = click.option(
    "--env",
    type=EnvironmentArgument(),
    multiple=True,
    callback=as_mapping,
    metavar="NAME=VALUE",
    help="Argument of the environment; repeatable. VALUE is JSON, or else a text, as in "
    "is_slippery=false or map_name=8x8.",
)
json_option: Decorator = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON document on standard output."
)


def echo_json(values: Any) -> None:
    """Print `values` as the one JSON document of a command."""
    click.echo(json.dumps(values, indent=1, allow_nan=False))


def echo_note(words: str) -> None:
    """Print words beside the answer of a command, on standard error."""
    click.echo(words, err=True)
