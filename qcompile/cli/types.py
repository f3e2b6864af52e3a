"""The types of option values."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.limits import MAX_SHOTS, MOST_AHEAD

if TYPE_CHECKING:
    from qcompile.mitigation.measure import Part


class Integer(click.IntRange):
    """An integer in a range."""

    name = "integer"


class Shots(click.ParamType[int | str | None]):
    """A number of shots, or `word`, whose value is `meaning`.

    "exact" asks for expectations without shot noise.
    """

    name = "shots"

    def __init__(self, word: str = "exact", meaning: str | None = None):
        self._word, self._meaning = word, meaning

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return f"N|{self._word}"

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
                f"{shots} is not in the range 1 to {MAX_SHOTS} (1024 and 8192 are usual), "
                f"nor '{self._word}'.",
                param,
                ctx,
            )
        return shots


class Depth(click.ParamType["int | str"]):
    """The number of decisions per episode that one job measures, or "auto"."""

    name = "depth"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return "D|auto"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        if value == "auto":
            return "auto"
        if not str(value).isdecimal() or not 1 <= int(value) <= MOST_AHEAD:
            self.fail(f"{value} is neither a number from 1 to {MOST_AHEAD} nor 'auto'.", param, ctx)
        return int(value)


class Share(click.FloatRange):
    """A number above 0 and at most 1, or below 1 with `open_end`."""

    name = "number"

    def __init__(self, *, open_end: bool = False) -> None:
        super().__init__(0, 1, min_open=True, max_open=open_end)

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number: float = super().convert(value, param, ctx)
        if math.isnan(number):  # passes every comparison with the range
            self.fail(f"{value!r} is not a number.", param, ctx)
        return number


class Positive(click.FloatRange):
    """A positive number of a unit; infinity is allowed if `most` is None."""

    name = "number"

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
    """Qubit numbers separated by commas; sorted, without duplicates."""

    name = "0,1,5"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        parts = [part.strip() for part in str(value).split(",")]
        if not all(part.isdecimal() and len(part) < 7 for part in parts):
            self.fail(f"{value!r} is not a list of qubits, such as 0,1,5.", param, ctx)
        return tuple(sorted({int(part) for part in parts}))


class Parts(click.ParamType["tuple[Part, ...]"]):
    """The parts of a calibration to measure, separated by commas."""

    name = "parts"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return "readout,response"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Part, ...]:
        from qcompile.mitigation.measure import PARTS

        parts = [part.strip() for part in str(value).split(",")]
        for part in parts:
            if part not in PARTS:
                self.fail(f"{part!r} is neither readout nor response.", param, ctx)
        return tuple(part for part in PARTS if part in parts)


class OutputPath(click.Path):
    """The path of a file to write, whose name must end with one of `suffixes`."""

    def __init__(self, *suffixes: str) -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self._suffixes = suffixes

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.suffix not in self._suffixes:
            *most, last = self._suffixes
            names = f"{', '.join(most)} or {last}" if most else last
            self.fail(f"{path} must end with {names}.", param, ctx)
        return path


class NamePath(click.types.StringParamType):
    """A name, or the path of a file."""


class Several(click.ParamType[tuple[Any, ...]]):
    """Values of another type, separated by commas."""

    def __init__(self, inner: click.ParamType[Any]):
        self.inner, self.name = inner, inner.name

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        return self.inner.get_metavar(param, ctx)

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Any, ...]:
        parts = [part.strip() for part in str(value).split(",")]
        if not all(parts):
            self.fail(f"{value!r} has an empty value beside a comma.", param, ctx)
        return tuple(self.inner.convert(part, param, ctx) for part in parts)
