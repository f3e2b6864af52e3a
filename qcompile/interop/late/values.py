"""Values of the parameters of a Qiskit circuit, for whole batches, and PUBs.

Source: qiskit.primitives.containers, BindingsArray, ObservablesArray, SamplerPub and EstimatorPub.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, real_array
from qcompile.errors import CircuitError
from qcompile.interop.late.instructions import Instructions


def expression_values(instructions: Instructions) -> Callable[[FloatArray], FloatArray]:
    """The expressions as a function of the parameters, (B, P) to (B, expressions)."""
    if not instructions.expressions:
        return lambda values: np.zeros((len(values), 0))
    import sympy

    # The user's names may be no identifiers, or those that cse gives to shared parts: x0, x1, ...
    symbols = {p.sympify(): sympy.Symbol(f"p{i}") for i, p in enumerate(instructions.parameters)}
    formulas = [e.sympify().xreplace(symbols) for e in instructions.expressions]
    compute = sympy.lambdify([*symbols.values()], formulas, modules="numpy", cse=True)

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
    if isinstance(values, dict | BindingsArray):
        try:
            values = BindingsArray.coerce(values).as_array(circuit.parameters)
        except (ValueError, TypeError) as error:
            raise CircuitError(f"The values do not fit the circuit: {error}") from error
    array = real_array(values)
    if array is None or not array.ndim or array.shape[-1] != count:
        found = "are not an array of real numbers" if array is None else f"have shape {array.shape}"
        raise CircuitError(
            f"The values {found}.",
            f"The last axis must be the {count} parameters of the circuit, as real numbers.",
        )
    return array


def read_pub(pub: Any) -> Any:
    from qiskit.primitives.containers import EstimatorPub, SamplerPub

    if isinstance(pub, SamplerPub | EstimatorPub):
        return pub
    try:
        if isinstance(pub, tuple | list) and len(pub) > 1 and _has_observables(*pub[:3]):
            return EstimatorPub.coerce(tuple(pub))
        return SamplerPub.coerce(tuple(pub) if isinstance(pub, list) else pub)
    except (ValueError, TypeError) as error:
        raise CircuitError(f"Qiskit cannot read this as a PUB: {error}") from error


def _has_observables(circuit: Any, second: Any, third: Any = None) -> bool:
    """Whether the second part of a PUB is observables, not values.

    Before shots, or nothing, an empty array is values, and so are those of parameters by name.
    """
    from qiskit.primitives.containers import ObservablesArray

    if third is None or isinstance(third, int | np.integer):
        names = {parameter.name for parameter in getattr(circuit, "parameters", ())}
        is_named = isinstance(second, dict) and names >= second.keys()
        if is_named or (isinstance(second, list | tuple | np.ndarray) and not np.size(second)):
            return False
    try:
        ObservablesArray.coerce(second)
    except (TypeError, ValueError, AttributeError):
        return False
    return True
