"""The labels of gates: runs of text, raised or lowered."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from qcompile.ir import Angle, Gate

SIZE, SMALL = 13.0, 9.0
"""Font sizes in px: of labels and of what is lowered or raised."""
_LETTER_EM = 0.62

GREEK = {"alpha": "α", "beta": "β", "gamma": "γ", "theta": "θ", "phi": "φ", "lambda": "λ"}

_FIXED = {
    "id": ("I", ""),
    "sdg": ("S", "†"),
    "tdg": ("T", "†"),
    "sx": ("√X", ""),
    "sxdg": ("√X", "†"),
}
_INDEXED = re.compile(r"(.*?)_?([0-9]+)")


@dataclass(frozen=True)
class Run:
    """A piece of a label, with what is lowered or raised behind it; `is_symbol` of variables."""

    text: str
    low: str = ""
    high: str = ""
    is_symbol: bool = False


def label(gate: Gate) -> list[Run]:
    """The label of a gate: √X, or R_y(x_0 + π/2)."""
    if gate.is_coupling:
        return [Run(gate.name.upper())]
    if gate.angle is None:
        words, high = _FIXED.get(gate.name, (gate.name.upper(), ""))
        return [Run(words, high=high)]
    name = Run("R", gate.name[1:]) if gate.name.startswith("r") else Run(gate.name.upper())
    return [name, Run("("), *_angle(gate.angle), Run(")")]


def _angle(angle: Angle) -> list[Run]:
    runs: list[Run] = []
    for symbol, coefficient in angle.terms:
        runs.append(Run(_sign(coefficient, bool(runs))))
        if abs(coefficient) != 1.0:
            runs.append(Run(f"{abs(coefficient):.4g} "))
        runs.append(_symbol(symbol))
    if angle.constant or not runs:
        runs.append(Run(_sign(angle.constant, bool(runs)) + _number(abs(angle.constant))))
    return [run for run in runs if run.text]


def _sign(value: float, follows: bool) -> str:
    if follows:
        return " − " if value < 0 else " + "
    return "−" if value < 0 else ""


def _number(value: float) -> str:
    """A fraction of π as such, other numbers to four digits."""
    words = str(Angle(value))
    return words.replace("*", "").replace("pi", "π") if "pi" in words else f"{value:.4g}"


def _symbol(name: str) -> Run:
    found = _INDEXED.fullmatch(name)
    base, index = (found[1], found[2]) if found is not None and found[1] else (name, "")
    return Run(GREEK.get(base, base), index, is_symbol=True)


def width_px(runs: Iterable[Run]) -> float:
    """What a label needs, in px, as letters are wide on average."""
    return _LETTER_EM * sum(
        len(run.text) * SIZE + max(len(run.low), len(run.high)) * SMALL for run in runs
    )
