"""Turning names of other packages into symbols, split into inputs and parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from qcompile.errors import CircuitError

INPUT_PREFIX = "x"
"""By default, names with this prefix are inputs."""

Inputs = str | Iterable[Any] | None
"""Which names are inputs: a prefix, or names and objects with a `name`; None: INPUT_PREFIX."""


def natural(names: Iterable[str]) -> list[str]:
    """`names` sorted with their numbers as numbers: x2 before x10, x[2] before x[10]."""

    def key(name: str) -> list[tuple[int, int, str]]:
        parts = re.split(r"([0-9]+)", name)
        return [(0, int(p), "") if i % 2 else (1, 0, p) for i, p in enumerate(parts)]

    return sorted(names, key=key)


def split(names: Sequence[str], inputs: Inputs = None) -> tuple[list[str], list[str]]:
    """`names` split into inputs and parameters, both in their order.

    A text is a prefix; leading underscores of names are ignored. If `inputs` is a list, inputs have
    its order, and an object with a `name` (a Parameter) that no circuit uses is still an input, so
    that x keeps its width. The name of a vector includes its elements.

    Raises:
        CircuitError: no name starts with the prefix, or a text of the list is not among `names`.
    """
    if inputs is None or isinstance(inputs, str):
        prefix = INPUT_PREFIX if inputs is None else inputs
        chosen = [name for name in names if name.lstrip("_").startswith(prefix)]
        if inputs is not None and not chosen:
            raise _unknown(f"No parameter starts with {prefix!r}.", names)
    else:
        entries = [inputs] if hasattr(inputs, "name") and not hasattr(inputs, "params") else inputs
        chosen = [name for entry in entries for name in _named(entry, names)]
        repeated = [name for name in chosen if chosen.count(name) > 1]
        if repeated:
            raise CircuitError(f"inputs names {repeated[0]!r} twice.", "Name each input once.")
    return chosen, [name for name in names if name not in set(chosen)]


def _named(entry: Any, names: Sequence[str]) -> list[str]:
    if hasattr(entry, "params"):  # a ParameterVector
        return [element.name for element in entry.params]
    if hasattr(entry, "name"):
        return [str(entry.name)]
    matches = [name for name in names if name == entry or name.startswith(f"{entry}[")]
    if not matches:
        raise _unknown(f"inputs names {str(entry)!r}, which the circuit does not have.", names)
    return matches


def _unknown(what: str, names: Sequence[str]) -> CircuitError:
    if not names:
        return CircuitError(what, "The circuit has no parameters.")
    return CircuitError(what, f"Its parameters: {', '.join(names)[:300]}.")


def symbols(names: Iterable[str]) -> dict[str, str]:
    """A symbol for each name: the name if it is valid, x3 for x[3], else with underscores."""
    names = list(names)
    result = {name: name for name in names if re.fullmatch(r"[^\W\d]\w*", name) and name != "pi"}
    for name in names:
        if name in result:
            continue
        element = re.fullmatch(r"(.*)\[([0-9]+)\]", name)
        plain = "".join(element.groups()) if element else name
        symbol = re.sub(r"\W", "_", plain)
        if not symbol or symbol[0].isdigit():
            symbol = f"_{symbol}"
        while symbol in result.values() or symbol == "pi":
            symbol += "_"
        result[name] = symbol
    return result


def not_affine(angle: str) -> CircuitError:
    """The error for an angle that is not affine in the symbols."""
    return CircuitError(
        f"{angle[:80]} is not an affine angle.",
        "An angle is a sum of numbers, and numbers times inputs or parameters: 0.5*x0+theta0.",
        "An Ansatz, for training, may also contain an input times one parameter: theta1*x0.",
        "Put other scales of inputs, and functions such as arctan, into the policy's Encoder.",
    )


def at(gate: str, what: str, operands: Sequence[Any], within: Sequence[str]) -> str:
    """A gate and its operands as text; `within` names the gates it is part of, outermost first.

    `what` is the package's word for an operand: "qubit" or "wire".
    """
    plural = "s" if len(operands) > 1 else ""
    inside = f" (within {' > '.join(within)})" if within else ""
    return f"{gate} on {what}{plural} {', '.join(map(str, operands))}{inside}"


def unknown(gate: str, where: str) -> CircuitError:
    """The error for a gate that is neither known nor defined; `where` is the text of `at`."""
    advice = {
        "reset": "Qubits start in |0>; remove the reset.",
        "if_else": "Keep only the branch that runs.",
    }.get(gate, "Remove it, or replace it with standard gates.")
    return CircuitError(
        f"{where} is not a gate that qcompile can compile.",
        "Circuits may contain standard gates, gates made of them, and measurements at the end.",
        advice,
    )
