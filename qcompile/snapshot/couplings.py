"""The couplings of a Qiskit backend, as Couplings of a Device, and where its qubits are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from pydantic import ValidationError

from qcompile.device import Coupling
from qcompile.ir import COUPLINGS

_MAX_ERROR = 0.5
"""IBM gives couplings that do not work an error of 1."""


def couplings_of_properties(properties: Any, number: Callable[[Any], float]) -> list[Coupling]:
    """The couplings that work, by a backend's properties; `number` converts a value with a unit."""
    faulty = {(gate.gate, tuple(gate.qubits)) for gate in properties.faulty_gates()}
    return [
        *_usable(
            (gate.gate, gate.qubits, {value.name: number(value) for value in gate.parameters})
            for gate in properties.gates
            if gate.gate in COUPLINGS and (gate.gate, tuple(gate.qubits)) not in faulty
        )
    ]


def couplings_of_target(target: Any) -> list[Coupling]:
    """The couplings that work, by a backend's target."""
    return [
        *_usable(
            (gate, qubits, {"gate_error": found.error, "gate_length": found.duration * 1e9})
            for gate in COUPLINGS
            if gate in target.operation_names
            for qubits, found in (target[gate] or {}).items()
            if found is not None and found.error is not None and found.duration is not None
        )
    ]


def positions_of(backend: Any, qubits: int) -> tuple[tuple[float, float], ...]:
    """Where IBM draws the qubits, to the right and downwards; empty if it does not say."""
    configuration = getattr(backend, "configuration", None)
    found = getattr(configuration() if callable(configuration) else None, "coords", None)
    try:
        positions = tuple((float(x), float(y)) for x, y in found or ())
    except (TypeError, ValueError):  # some other backend's idea of them
        return ()
    return positions if len(positions) == qubits else ()


def _usable(found: Iterable[tuple[str, Sequence[int], dict[str, float]]]) -> Iterator[Coupling]:
    for gate, qubits, values in sorted(found, key=lambda each: (each[0], *each[1])):
        if values.keys() >= {"gate_error", "gate_length"} and values["gate_error"] < _MAX_ERROR:
            try:
                yield Coupling.model_validate(
                    {
                        "gate": gate,
                        "qubits": tuple(qubits),
                        "error": values["gate_error"],
                        "length_ns": values["gate_length"],
                    }
                )
            except ValidationError:  # an impossible value: the coupling cannot be used
                continue
