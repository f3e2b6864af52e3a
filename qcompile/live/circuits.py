"""Any circuits: told apart in a journal, and held to what a machine can run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from qcompile.errors import LiveError
from qcompile.terminal import first_line

_QISKIT = ("qiskit.", "qiskit_ibm_runtime.")
_DIGITS = 9
"""Of an angle: another processor may round the last ones otherwise."""


def rounded(values: Any) -> Any:
    """Angles as a journal tells them apart, an array, and 0 for -0."""
    return np.round(values, _DIGITS) + 0.0


def circuit_text(circuit: Any) -> str:
    """A QuantumCircuit in words: the same for the same measurement, whichever version wrote it.

    They are its registers, the names of its parameters and its instructions in order, with their
    qubits, bits and angles. One with control flow is told by its OpenQASM 3.

    Raises:
        LiveError: its control flow has no OpenQASM 3.
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
        own = kind in (Gate, Instruction) or not kind.__module__.startswith(_QISKIT)
        if own and (definition := getattr(operation, "definition", None)) is not None:
            yield from (f"  {line}" for line in _lines(definition))


def _value(value: Any) -> str:
    """A number, an array, an expression of parameters, or a word."""
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
            "A journal tells it from others by that. Nothing was sent.",
        ) from error


def unsupported(circuit: Any, target: Any) -> str | None:
    """What of a circuit is not among the instructions of a machine's Target, in words, if any."""
    if circuit.num_qubits > (target.num_qubits or 0):
        return f"It has {circuit.num_qubits} qubits, the machine {target.num_qubits}."
    return _unsupported(circuit, target, range(circuit.num_qubits))


def _unsupported(circuit: Any, target: Any, qubits: Sequence[int]) -> str | None:
    """`qubits` are those of the machine on which the circuit's own lie."""
    places = dict(zip(circuit.qubits, qubits, strict=True))
    for instruction in circuit.data:
        operation = instruction.operation
        own = tuple(places[qubit] for qubit in instruction.qubits)
        for block in getattr(operation, "blocks", ()):
            if words := _unsupported(block, target, own):
                return words
        if operation.name in ("barrier", "store") or hasattr(operation, "blocks"):
            continue
        if not target.instruction_supported(operation.name, own):
            on = f"qubit {own[0]}" if len(own) == 1 else f"qubits {own}"
            return f"Its {operation.name} on {on} is not an instruction of the machine."
    return None
