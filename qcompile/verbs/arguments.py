"""Check the arguments of verbs against their signatures, before anything is done with them."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import cache, wraps
from inspect import signature
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from qcompile.calibration import Calibration, age_warnings, load_calibration
from qcompile.caller import option
from qcompile.errors import OptionError
from qcompile.limits import MAX_EPISODES
from qcompile.page.words import call as call_words
from qcompile.sweep.arguments import Name, Planned, Words, is_several, several
from qcompile.verbs.reports import Reported

P = ParamSpec("P")
R = TypeVar("R")

_RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, math.inf),
    "max_steps": (1, math.inf),
    "copies": (1, MAX_EPISODES),
    "observations": (1, 1000),
    "power": (0, 1),
    "effect": (0, 1),
    "usd_per_second": (0, 1e9),
    "seeds": (1, 1000),
    "evaluation": (1, MAX_EPISODES),
    "evaluate_every": (1, math.inf),
    "evaluate_episodes": (1, MAX_EPISODES),
    "workers": (1, 10_000),
}
"""The ranges of arguments that are not checked elsewhere; the command line has the same ranges."""

_WORDS: Mapping[str, tuple[str, ...]] = {
    "bool": ("True", "False"),
    "int": ("a whole number",),
    "float": ("a number",),
    "str": ("a string",),
    "Name": ("a name", "a path"),
    "Engine": ("a string",),
    "Shots": ("a whole number", "'exact'", "None"),
    "Live": ("a qcompile.Live",),
    "Planned": (),
    "Words": ("a function",),
    "Callback": ("a function of scalars and steps",),
    "Callable[[str], None]": ("a function",),
    "Literal['exact']": ("'exact'",),
    "Literal['auto']": ("'auto'",),
}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` with its plain arguments checked and converted on each call.

    NumPy numbers become Python numbers; arrays and generators become lists. The function checks
    arguments of other types itself. A result that has a report remembers the call. The function's
    module needs `from __future__ import annotations`.

    Raises:
        OptionError: on a call, an argument has the wrong type or is out of range.
    """
    form = signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = form.bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            bound.arguments[name] = _argument(name, value, str(form.parameters[name].annotation))
        result = function(*bound.args, **bound.kwargs)
        if isinstance(result, Reported):
            paths = [name for name, one in form.parameters.items() if "Name" in str(one.annotation)]
            result.call = call_words(function.__name__, bound.arguments, paths)
        return result

    return call


def calibration_settings(calibration: Name | Calibration | None, on_note: Words) -> dict[str, Any]:
    """The run settings for a calibration or its file; `on_note` is told if the file is old.

    Raises:
        CalibrationError: the file does not hold a calibration.
    """
    if not isinstance(calibration, str | PathLike):
        return {"calibration": calibration}
    file = str(Path(calibration))
    loaded = load_calibration(Path(calibration))
    for words in age_warnings(file, loaded, datetime.now(UTC)):
        on_note(words)
    return {"calibration": loaded, "calibration_file": file}


def _argument(name: str, value: Any, annotation: str) -> Any:
    plain, fits = _plain(value, annotation)
    if not fits:
        raise OptionError(
            f"{option(name)} cannot be {_shown(value)}.", f"It must be {_words(annotation)}."
        )
    least, most = _RANGES.get(name, (-math.inf, math.inf))
    if isinstance(plain, int | float) and not least <= plain <= most:
        limit = f"in [{least}, {most}]" if most < math.inf else f"{least} or more"
        raise OptionError(f"{option(name)} cannot be {_shown(value)}.", f"It must be {limit}.")
    return plain


def _plain(value: Any, annotation: str) -> tuple[Any, bool]:
    """The value converted to a plain type of the annotation, and whether it has such a type."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    atoms = _atoms(annotation)
    for atom in atoms:
        if atom.startswith("Sequence["):
            if not is_several(value):
                continue
            plain = [_plain(member, atom[len("Sequence[") : -1]) for member in several(value)]
            if all(fits for _, fits in plain):
                return [member for member, _ in plain], True
        elif atom in _KINDS and _KINDS[atom](value):
            if atom in ("int", "Shots") and value is not None and not isinstance(value, str):
                return int(value), True
            return {"bool": bool, "float": float}.get(atom, lambda same: same)(value), True
    known = (*_KINDS, "Sequence[")
    return value, not all(atom.startswith(known) for atom in atoms)


def _is_whole(value: Any) -> bool:
    if isinstance(value, bool | np.bool_):
        return False
    return isinstance(value, Integral) or (isinstance(value, float) and value.is_integer())


def _is_number(value: Any) -> bool:
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return False
    try:
        return not math.isnan(float(value))
    except OverflowError:  # a huge integer
        return False


def _is_name(value: Any) -> bool:
    return isinstance(value, str | PathLike) and "\0" not in str(value)


def _is_exact(value: Any) -> bool:
    return isinstance(value, str) and value == "exact"


def _is_live(value: Any) -> bool:
    from qcompile.verbs.live import Live

    return isinstance(value, Live)


_KINDS: Mapping[str, Callable[[Any], bool]] = {
    "None": lambda value: value is None,
    "bool": lambda value: isinstance(value, bool | np.bool_),
    "int": _is_whole,
    "float": _is_number,
    "str": lambda value: isinstance(value, str),
    "Name": _is_name,
    "Engine": lambda value: isinstance(value, str),
    "Part": lambda value: isinstance(value, str),
    "Shots": lambda value: value is None or _is_exact(value) or _is_whole(value),
    "Live": _is_live,
    "Planned": lambda value: isinstance(value, Planned),
    "Words": callable,
    "Callback": callable,
    "Callable[[str], None]": callable,
    "Mapping[str, Any]": lambda value: (
        isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    ),
    "Literal['exact']": _is_exact,
}


@cache
def _atoms(annotation: str) -> tuple[str, ...]:
    """The members of a union, as source text."""

    def members(node: ast.expr) -> list[ast.expr]:
        if isinstance(node, ast.BinOp):
            return members(node.left) + members(node.right)
        return [node]

    words = map(ast.unparse, members(ast.parse(annotation, mode="eval").body))
    return tuple("Sequence[int]" if atom == "IntArray" else atom for atom in words)


def _words(annotation: str) -> str:
    """The types of an annotation for a message, as in "a string, a path or None"."""
    words: dict[str, None] = {}
    for atom in _atoms(annotation):
        kinds = ("a list",) if atom.startswith("Sequence[") else _WORDS.get(atom, (atom,))
        words |= dict.fromkeys(kinds)
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


def _shown(value: Any) -> str:
    try:
        words = ascii(value)
    except Exception:  # an error of the object's own, or an integer with too many digits
        return f"a {type(value).__name__}"
    return words if len(words) <= 60 else f"{words[:57]}..."
