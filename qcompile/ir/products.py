"""Products of two symbols: what becomes of an angle such as "scale*x" until x is encoded.

A product stands in an angle as a symbol "a*b", which no program declares; `separated` gives each a
name of its own.
"""

from __future__ import annotations

from collections.abc import Iterable

from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle
from qcompile.ir.circuit import Circuit

MARK = "*"


def product(left: Angle, right: Angle) -> Angle:
    """Their product, in which that of two symbols is a symbol.

    Raises:
        CircuitError: it has a product of three symbols.
    """
    total = (left - left.constant) * right.constant + right * left.constant
    for a, c in left.terms:
        for b, d in right.terms:
            if MARK in a or MARK in b:
                raise CircuitError(
                    f"({left})*({right}) is a product of three symbols.",
                    "An angle may hold an input times one parameter: theta1*x0.",
                )
            total += Angle(0.0, ((MARK.join(sorted((a, b))), c * d),))
    return total


def separated(
    circuits: Iterable[Circuit], names: Iterable[str]
) -> tuple[tuple[Circuit, ...], dict[str, tuple[str, str]]]:
    """The circuits with a name for each product, none of `names`, and its two symbols by name."""
    circuits, taken = tuple(circuits), set(names)
    renamed: dict[str, str] = {}
    for symbol in (symbol for circuit in circuits for symbol in circuit.symbols):
        if MARK not in symbol or symbol in renamed:
            continue
        name = symbol.replace(MARK, "_")
        while name in taken:
            name += "_"
        renamed[symbol] = name
        taken.add(name)
    if not renamed:
        return circuits, {}
    pairs = {name: _symbols(symbol) for symbol, name in renamed.items()}
    return tuple(circuit.rename(renamed) for circuit in circuits), pairs


def _symbols(product_symbol: str) -> tuple[str, str]:
    first, second = product_symbol.split(MARK)
    return first, second
