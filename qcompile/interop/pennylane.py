"""Programs from PennyLane's quantum functions, QNodes and tapes.

A function is called once, with symbols instead of numbers, and the resulting tape is read.
Source: pennylane.tape, pennylane.ops.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from qcompile.errors import CircuitError, MissingExtraError
from qcompile.interop.measured import measured_circuits
from qcompile.interop.symbols import at, unknown
from qcompile.interop.tracing import TracedAngle, traced
from qcompile.interop.uploads import Uploads
from qcompile.ir import Angle, Gate, Program
from qcompile.ir.wires import Wires
from qcompile.limits import MAX_VALUES
from qcompile.qasm.gates import standard
from qcompile.qasm.modifiers import Unitary

Shape = int | tuple[int, ...]
_Step = tuple[Unitary, Sequence[Any]]
"""What is done, and the wires that it is done to."""

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
    "CNOT": "cx",
    "CY": "cy",
    "CZ": "cz",
    "CH": "ch",
    "SWAP": "swap",
    "ISWAP": "iswap",
    "ECR": "ecr",
    "PSWAP": "pswap",
    "CRX": "crx",
    "CRY": "cry",
    "CRZ": "crz",
    "ControlledPhaseShift": "cp",
    "CPhaseShift00": "cphaseshift00",
    "CPhaseShift01": "cphaseshift01",
    "CPhaseShift10": "cphaseshift10",
    "IsingXX": "rxx",
    "IsingYY": "ryy",
    "IsingZZ": "rzz",
    "IsingXY": "xy",
    "Toffoli": "ccx",
    "CCZ": "ccz",
    "CSWAP": "cswap",
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
    wires = Wires()
    numbers = {wire: number for number, wire in enumerate(tape.wires)}
    for operation in tape.operations:
        for unitary, on in _expanded(operation):
            wires.apply(unitary.steps, [numbers[wire] for wire in on])
    circuits, qubits = wires.circuits(len(numbers))
    bit_of = {tape.wires[qubit]: bit for bit, qubit in enumerate(qubits)}
    owners = [index for index, circuit in enumerate(circuits) for _ in range(circuit.width)]
    observed = []
    for on in _measured(tape):
        observed.append([bit_of[wire] for wire in on])
        if len({owners[bit] for bit in observed[-1]}) > 1:
            raise CircuitError(
                f"No gates connect the wires {', '.join(map(str, on))}, whose product is measured.",
                "Measure Z of each: <Z> of the product is the product of theirs.",
            )
    measured = measured_circuits(circuits, list(dict.fromkeys(chain.from_iterable(observed))))
    symbols = (("x", inputs), ("theta", parameters))
    input_names, parameter_names = (
        [f"{name}{i}" for i in range(_size(shape))] for name, shape in symbols
    )
    return Uploads.of(
        measured.circuits,
        dict(zip(input_names, input_names, strict=True)),
        dict(zip(parameter_names, parameter_names, strict=True)),
        observables=[tuple(measured.bits[bit] for bit in bits) for bits in observed],
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


def _expanded(operation: Any, within: tuple[str, ...] = ()) -> Iterator[_Step]:
    """The steps of an operation, in order."""
    name, wires = operation.name, list(operation.wires)
    if name in _WITHOUT_EFFECT:
        return
    if (unitary := _known(operation)) is not None:
        yield unitary, wires
        return
    if name.startswith("Adjoint("):
        for part, on in reversed([*_expanded(operation.base, within)]):
            yield part.inverse(), on
        return
    if not getattr(operation, "has_decomposition", False):
        raise unknown(name, at(name, "wire", wires, within))
    for inner in operation.decomposition():
        yield from _expanded(inner, (*within, name))


def _known(operation: Any) -> Unitary | None:
    """The unitary of an operation of the table, adjoint or controlled; None for any other."""
    from pennylane.ops.op_math import Controlled

    name = operation.name
    if name in _GATES:
        return standard(_GATES[name], [_angle(value, name) for value in operation.data])
    if name == "Rot":
        first, middle, last = (_angle(value, name) for value in operation.data)
        return Unitary((Gate("rz", first), Gate("ry", middle), Gate("rz", last)))
    if name.startswith("Adjoint("):
        base = _known(operation.base)
        return None if base is None else base.inverse()
    if isinstance(operation, Controlled) and (base := _known(operation.base)) is not None:
        unitary = base.controlled(len(operation.control_wires))
        flips = [Gate("x", None, (k,)) for k, on in enumerate(operation.control_values) if not on]
        return Unitary((*flips, *unitary.gates, *flips), unitary.width)
    return None


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


def _measured(tape: Any) -> list[tuple[Any, ...]]:
    """The products of Z that are measured, each as its wires; every wire if none is."""
    import pennylane as qml

    products: list[tuple[Any, ...]] = []
    for measurement in tape.measurements:
        observable = measurement.obs
        if isinstance(measurement, qml.measurements.ExpectationMP):
            products.append(_product_of_z(observable))
            continue
        if observable is not None:
            raise CircuitError(
                f"The measurement {measurement} is not supported.",
                "Return expectation values of qml.Z, or counts, samples or probabilities.",
            )
        products += [(wire,) for wire in list(measurement.wires) or list(tape.wires)]
    for number, product in enumerate(products):
        if set(product) in map(set, products[:number]):
            what = "Wire" if len(product) == 1 else "The product of wires"
            raise CircuitError(
                f"{what} {', '.join(map(str, product))} is measured twice.",
                "Measure each wire, and each product, once.",
            )
    return products or [(wire,) for wire in tape.wires]


def _product_of_z(observable: Any) -> tuple[Any, ...]:
    """The wires of an observable that is a product of Z of different wires.

    Raises:
        CircuitError: it is another observable.
    """
    terms = observable.pauli_rep or {}
    (word, factor), *others = terms.items() or [({}, 0)]
    if others or factor != 1 or {*word.values()} != {"Z"}:
        raise CircuitError(
            f"expval({observable}) is not a product of Z.",
            "Measure Z of wires, or products: return [qml.expval(qml.Z(0) @ qml.Z(1)), ...].",
            "Rotate another axis to Z first, X with qml.Hadamard for instance.",
        )
    return tuple(wire for wire in observable.wires if wire in word)
