"""Circuits as another package has them, with products of an input and a trained factor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from qcompile.interop.symbols import not_affine
from qcompile.ir import Circuit, Program
from qcompile.ir.products import separated


@dataclass(frozen=True)
class Uploads:
    """A program whose last inputs are products, and the names of its symbols where it comes from.

    `inputs` and `parameters` name the program's symbols in order. Further inputs of the program are
    products: `products` has the numbers of the input and of the parameter of each.
    """

    program: Program
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    products: tuple[tuple[int, int], ...]

    @classmethod
    def of(
        cls,
        circuits: Iterable[Circuit],
        inputs: Mapping[str, str],
        parameters: Mapping[str, str],
        pairs: Mapping[str, tuple[str, str]] | None = None,
    ) -> Uploads:
        """Those of circuits whose angles may hold products; `inputs` has names by symbol.

        Where products have names already, `pairs` has the two symbols of each.

        Raises:
            CircuitError: a product is not one of an input and a parameter.
        """
        if pairs is None:
            circuits, pairs = separated(circuits, (*inputs, *parameters))
        input_of = {symbol: index for index, symbol in enumerate(inputs)}
        parameter_of = {symbol: index for index, symbol in enumerate(parameters)}
        products = []
        for first, second in pairs.values():
            x, theta = (first, second) if first in input_of else (second, first)
            if x not in input_of or theta not in parameter_of:
                raise not_affine(f"{first}*{second}")
            products.append((input_of[x], parameter_of[theta]))
        program = Program(tuple(circuits), (*inputs, *pairs), (*parameters,))
        return cls(program, (*inputs.values(),), (*parameters.values(),), tuple(products))
