"""Programs from PennyLane's quantum functions, QNodes and tapes.

A function is called once, with symbols instead of numbers, and the resulting tape is read.
Source: pennylane.tape, pennylane.ops.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from qcompile.errors import CircuitError, MissingExtraError
from qcompile.interop.symbols import at, entangles, unknown
from qcompile.interop.tracing import TracedAngle, traced
from qcompile.interop.uploads import Uploads
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.limits import MAX_VALUES
from qcompile.qasm.gates import standard
from qcompile.qasm.modifiers import inverse

Shape = int | tuple[int, ...]

_GATES = {
    "Hadamard": "h",
    "PauliX": "x",
    "PauliY": "y",
    "PauliZ": "z",
    "S": "s",
    "T": "t",
    "SX": "sx",
    "RX": "rx",
    "RY": "ry",
    "RZ": "rz",
    "PhaseShift": "p",
    "U1": "u1",
    "U2": "u2",
    "U3": "u3",
}
"""PennyLane's names for the gates of `qasm.gates`, with their angles in the same order."""

_WITHOUT_EFFECT = ("Identity", "GlobalPhase", "Barrier", "Snapshot", "WireCut")


def program_of(function: Any, inputs: Shape = 0, parameters: Shape = 0) -> Program:
    """The program of a quantum function, a QNode or a tape; see `Program.from_pennylane`."""
    return _read(function, inputs, parameters, products=False).program


def uploads_of(function: Any, inputs: Shape = 0, parameters: Shape = 0) -> Uploads:
    """The same, with products of inputs and parameters; see `Ansatz.from_pennylane`."""
    return _read(function, inputs, parameters, products=True)


def _read(function: Any, inputs: Shape, parameters: Shape, products: bool) -> Uploads:
    try:
        import pennylane as qml
    except ImportError as error:
        raise MissingExtraError("Reading a PennyLane circuit", "pennylane") from error
    inputs, parameters = _shape("inputs", inputs), _shape("parameters", parameters)
    tape = function
    if isinstance(function, qml.tape.QuantumScript):
        if inputs != 0 or parameters != 0:
            raise CircuitError(
                "A tape contains only numbers, so it has no inputs or parameters.",
                "Pass the quantum function that makes the tape instead.",
            )
    else:
        tape = _traced_tape(function, inputs, parameters, products)
    gates: dict[Any, list[Gate]] = {wire: [] for wire in tape.wires}
    for operation in tape.operations:
        for wire, gate in _expanded(operation):
            gates[wire].append(gate)
    circuits = [Circuit(tuple(gates[wire])) for wire in _measured(tape)]
    symbols = (("x", inputs), ("theta", parameters))
    input_names, parameter_names = (
        [f"{name}{i}" for i in range(_size(shape))] for name, shape in symbols
    )
    return Uploads.of(
        circuits,
        dict(zip(input_names, input_names, strict=True)),
        dict(zip(parameter_names, parameter_names, strict=True)),
    )


def _shape(name: str, shape: Any) -> Shape:
    """The shape, or the number of angles, as Python integers.

    Raises:
        CircuitError: it is neither.
    """
    try:
        if hasattr(shape, "__index__"):
            numbers = [operator.index(shape)]
            checked: Shape = numbers[0]
        else:
            numbers = [operator.index(size) for size in shape]
            checked = tuple(numbers)
    except TypeError:
        numbers = [-1]
    if any(not 0 <= number <= MAX_VALUES for number in numbers):
        raise CircuitError(
            f"{name} cannot be {shape!r:.60}.", "Give a number of angles, or a shape like (2, 3)."
        )
    return checked


def _size(shape: Shape) -> int:
    return int(np.prod(shape, dtype=int))


def _traced_tape(function: Any, inputs: Shape, parameters: Shape, products: bool) -> Any:
    """The tape of one call, with a symbol for every input and parameter."""
    import autoray
    import pennylane as qml

    if isinstance(function, qml.QNode):
        function = function.func
    if not callable(function):
        raise CircuitError(
            f"{'Ansatz' if products else 'Program'}.from_pennylane takes a quantum function, "
            f"a QNode or a tape, found {type(function).__name__}."
        )
    autoray.register_backend(TracedAngle, "numpy")
    named = (("x", inputs), ("theta", parameters))
    arguments = [traced(name, shape, products) for name, shape in named if shape != 0]
    try:
        return qml.tape.make_qscript(function)(*arguments)
    except CircuitError:
        raise
    except (TypeError, ValueError, AttributeError, IndexError, ImportError) as error:
        shapes = " and ".join(f"{name} of shape {shape}" for name, shape in named if shape != 0)
        raise CircuitError(
            "The quantum function cannot be called with symbols in place of numbers.",
            f"It was given {shapes or 'no arguments'}: {str(error)[:200]}",
            "Set inputs= and parameters= to the sizes or shapes of its arguments.",
            "Angles may be computed from these only with + and -, and * and / by numbers.",
        ) from error


def _expanded(operation: Any, within: tuple[str, ...] = ()) -> Iterator[tuple[Any, Gate]]:
    """The wire and gate of each step of an operation, in order."""
    name, wires = operation.name, list(operation.wires)
    if name in _WITHOUT_EFFECT:
        return
    where = at(name, "wire", wires, within)
    if len(wires) == 1 and (gates := _of_one_wire(operation)) is not None:
        yield from ((wires[0], gate) for gate in gates)
        return
    if _is_controlled(operation) and len(wires) > 1:
        raise entangles(name, where)
    if not getattr(operation, "has_decomposition", False):
        if len(wires) > 1:
            raise entangles(name, where)
        raise unknown(name, where)
    for part in operation.decomposition():
        yield from _expanded(part, (*within, name))


def _of_one_wire(operation: Any) -> Sequence[Gate] | None:
    """The gates of a known operation on one wire; None if it must be decomposed."""
    name = operation.name
    if name.startswith("Adjoint("):
        base = [gate for _, gate in _expanded(operation.base)]
        return inverse(base)
    if name == "Rot":
        first, middle, last = (_angle(value, name) for value in operation.data)
        return standard("u", (middle, last, first))
    if name in _GATES:
        return standard(_GATES[name], [_angle(value, name) for value in operation.data])
    return None


def _is_controlled(operation: Any) -> bool:
    from pennylane.ops.op_math import Controlled

    return isinstance(operation, Controlled)


def _angle(value: Any, gate: str) -> Angle:
    if isinstance(value, TracedAngle):
        return value.angle
    array = np.asarray(value)
    if array.shape != ():
        raise CircuitError(
            f"{gate} has an array of angles of shape {array.shape}.",
            "A gate takes one angle: index the array, as in x[0].",
        )
    item = array.item()
    return item.angle if isinstance(item, TracedAngle) else Angle.of(float(item))


def _measured(tape: Any) -> list[Any]:
    """The wires that become circuits: the measured ones, in that order, or all if none is."""
    import pennylane as qml

    wires: list[Any] = []
    for measurement in tape.measurements:
        observable = measurement.obs
        if isinstance(measurement, qml.measurements.ExpectationMP):
            if not isinstance(observable, qml.Z):
                raise CircuitError(
                    f"expval({observable}) is not the Z of one wire.",
                    "Measure Z of single wires: return [qml.expval(qml.Z(0)), ...].",
                    "Rotate another axis to Z first, X with qml.Hadamard for instance.",
                )
        elif observable is not None:
            raise CircuitError(
                f"The measurement {measurement} is not supported.",
                "Return expectation values of qml.Z, or counts, samples or probabilities.",
            )
        wires += list(measurement.wires) or list(tape.wires)
    repeated = [wire for wire in wires if wires.count(wire) > 1]
    if repeated:
        raise CircuitError(f"Wire {repeated[0]} is measured twice.", "Measure each wire once.")
    return wires or list(tape.wires)
