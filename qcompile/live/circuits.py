"""Arbitrary circuits: a stable text for the journal, and a check against the machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from qcompile.errors import LiveError
from qcompile.terminal import first_line

_QISKIT = ("qiskit.", "qiskit_ibm_runtime.")
_DIGITS = 9
"""Digits of an angle that are compared: another processor may round the last ones differently."""


def rounded(values: Any) -> Any:
    """Angles rounded as the journal compares them, as an array, with 0 for -0."""
    return np.round(values, _DIGITS) + 0.0


def circuit_text(circuit: Any) -> str:
    """A QuantumCircuit as text: equal for equal circuits, whichever Qiskit version made them.

    The text lists registers, parameter names and instructions in order, with their qubits, bits and
    angles. A circuit with control flow is written as OpenQASM 3.

    Raises:
        LiveError: its control flow cannot be written as OpenQASM 3.
    """
    from qiskit.circuit import ControlFlowOp

    bits = {bit: index for index, bit in enumerate(circuit.clbits)}
    registers = [(register.name, [bits[bit] for bit in register]) for register in circuit.cregs]
    names = [parameter.name for parameter in circuit.parameters]
    head = f"{circuit.num_qubits} {registers} {names}"
    if any(isinstance(instruction.operation, ControlFlowOp) for instruction in circuit.data):
        return f"{head}\n{_qasm(circuit)}"
    return "\n".join((head, *_lines(circuit)))


def _lines(circuit: Any) -> Iterator[str]:
    from qiskit.circuit import Gate, Instruction

    qubits = {bit: index for index, bit in enumerate(circuit.qubits)}
    bits = {bit: index for index, bit in enumerate(circuit.clbits)}
    for instruction in circuit.data:
        operation = instruction.operation
        angles = [_value(value) for value in getattr(operation, "params", ())]
        places = [qubits[q] for q in instruction.qubits], [bits[c] for c in instruction.clbits]
        yield f"{operation.name} {angles} {places} {getattr(operation, 'unit', None)}"
        kind = getattr(operation, "base_class", type(operation))
        is_custom = kind in (Gate, Instruction) or not kind.__module__.startswith(_QISKIT)
        if is_custom and (definition := getattr(operation, "definition", None)) is not None:
            yield from (f"  {line}" for line in _lines(definition))


def _value(value: Any) -> str:
    """The text of a number, an array, an expression of parameters, or a word."""
    if getattr(value, "parameters", None):
        return str(value)
    try:
        number = np.asarray(value, dtype=np.complex128)
    except (TypeError, ValueError):
        return str(value)
    return str(rounded(number).tolist())


def _qasm(circuit: Any) -> str:
    from qiskit import qasm3
    from qiskit.exceptions import QiskitError

    try:
        return str(qasm3.dumps(circuit))
    except QiskitError as error:
        raise LiveError(
            f"The control flow of circuit {circuit.name} cannot be written as OpenQASM 3.",
            f"Qiskit says: {first_line(str(error))}",
            "The journal needs that text to recognise the circuit. Nothing was sent.",
        ) from error


def unsupported(circuit: Any, target: Any) -> str | None:
    """Why a circuit cannot run on a machine's Target, as a sentence; None if it can."""
    if circuit.num_qubits > (target.num_qubits or 0):
        return f"It has {circuit.num_qubits} qubits; the machine has {target.num_qubits}."
    return _unsupported(circuit, target, range(circuit.num_qubits))


def _unsupported(circuit: Any, target: Any, qubits: Sequence[int]) -> str | None:
    """`qubits` are the machine's qubits that the circuit's qubits are placed on."""
    places = dict(zip(circuit.qubits, qubits, strict=True))
    for instruction in circuit.data:
        operation = instruction.operation
        physical = tuple(places[qubit] for qubit in instruction.qubits)
        for block in getattr(operation, "blocks", ()):
            if words := _unsupported(block, target, physical):
                return words
        if operation.name in ("barrier", "store") or hasattr(operation, "blocks"):
            continue
        if not target.instruction_supported(operation.name, physical):
            on = f"qubit {physical[0]}" if len(physical) == 1 else f"qubits {physical}"
            return f"Its {operation.name} on {on} is not an instruction of the machine."
    return None
