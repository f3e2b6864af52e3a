"""Circuits of another package, whose angles may be products of an input and a parameter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from qcompile.interop.symbols import not_affine
from qcompile.ir import Circuit, Program
from qcompile.ir.products import separated


@dataclass(frozen=True)
class Uploads:
    """A program whose last inputs are products, and the original names of its symbols.

    `inputs` and `parameters` name the program's symbols in order. The remaining inputs of the
    program are products: `products` has the indices of the input and the parameter of each.
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
        observables: Iterable[tuple[int, ...]] = (),
    ) -> Uploads:
        """The uploads of circuits whose angles may contain products; `inputs` has names by symbol.

        If products have names already, `pairs` has the two symbols of each. `observables` are those
        of the program.

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
        program = Program(
            tuple(circuits), (*inputs, *pairs), (*parameters,), observables=tuple(observables)
        )
        return cls(program, (*inputs.values(),), (*parameters.values(),), tuple(products))
