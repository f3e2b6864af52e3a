"""Products of two symbols, such as "scale*x", in angles that are not affine.

In an angle a product is a symbol "a*b", which no program declares; `separated` gives each product
a name of its own.
"""

from __future__ import annotations

from collections.abc import Iterable

from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle
from qcompile.ir.circuit import Circuit

MARK = "*"


def product(left: Angle, right: Angle) -> Angle:
    """The product of two angles, with each product of two symbols as a symbol.

    Raises:
        CircuitError: the result contains a product of three symbols.
    """
    total = (left - left.constant) * right.constant + right * left.constant
    for a, c in left.terms:
        for b, d in right.terms:
            if MARK in a or MARK in b:
                raise CircuitError(
                    f"({left})*({right}) is a product of three symbols.",
                    "An angle may contain an input times one parameter: theta1*x0.",
                )
            total += Angle(0.0, ((MARK.join(sorted((a, b))), c * d),))
    return total


def separated(
    circuits: Iterable[Circuit], names: Iterable[str]
) -> tuple[tuple[Circuit, ...], dict[str, tuple[str, str]]]:
    """The circuits with a new symbol, not in `names`, for each product, and its two factors."""
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
