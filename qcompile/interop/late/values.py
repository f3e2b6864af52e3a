"""Values of the parameters of a Qiskit circuit, for whole batches, and PUBs.

Source: qiskit.primitives.containers, BindingsArray, ObservablesArray, SamplerPub and EstimatorPub.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import CircuitError
from qcompile.interop.late.instructions import Instructions


def expression_values(instructions: Instructions) -> Callable[[FloatArray], FloatArray]:
    """The expressions as a function of the parameters, (B, P) to (B, expressions)."""
    if not instructions.expressions:
        return lambda values: np.zeros((len(values), 0))
    import sympy

    symbols = [parameter.sympify() for parameter in instructions.parameters]
    texts = [expression.sympify() for expression in instructions.expressions]
    compute = sympy.lambdify(symbols, texts, modules="numpy", cse=True, dummify=True)

    def evaluate(values: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):  # angles that are not finite are refused together
            columns = compute(*values.T)
        found = np.empty((len(values), len(columns)))
        for column, of_column in enumerate(columns):
            if np.any(np.imag(of_column)):
                expression = instructions.expressions[column]
                raise CircuitError(f"The angle {expression} is not real for these values.")
            found[:, column] = np.real(of_column)
        return found

    return evaluate


def parameter_values(values: Any, circuit: Any) -> FloatArray:
    from qiskit.primitives.containers.bindings_array import BindingsArray

    count = len(circuit.parameters)
    if isinstance(values, dict):
        try:
            values = BindingsArray.coerce(values).as_array(circuit.parameters)
        except (ValueError, TypeError) as error:
            raise CircuitError(f"The values do not fit the circuit: {error}") from error
    array = np.asarray(values)
    if array.dtype.kind not in "biuf" or not array.ndim or array.shape[-1] != count:
        raise CircuitError(
            f"The values have shape {array.shape} and type {array.dtype}.",
            f"The last axis must be the {count} parameters of the circuit, as real numbers.",
        )
    return array.astype(float)


def read_pub(pub: Any) -> Any:
    from qiskit.primitives.containers import EstimatorPub, SamplerPub

    if isinstance(pub, SamplerPub | EstimatorPub):
        return pub
    try:
        if isinstance(pub, tuple | list) and len(pub) > 1 and _are_observables(pub[1]):
            return EstimatorPub.coerce(tuple(pub))
        return SamplerPub.coerce(tuple(pub) if isinstance(pub, list) else pub)
    except (ValueError, TypeError) as error:
        raise CircuitError(f"Qiskit cannot read this as a PUB: {error}") from error


def _are_observables(thing: Any) -> bool:
    from qiskit.primitives.containers import ObservablesArray

    if thing is None:
        return False
    try:
        ObservablesArray.coerce(thing)
    except (TypeError, ValueError, AttributeError):
        return False
    return True
