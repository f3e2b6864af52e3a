"""Programs from Qiskit circuits, and Qiskit circuits from executables.

Source: qiskit.circuit, QuantumCircuit and ParameterExpression; the gates are those of
`qasm.gates`, where they have the same names.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from qcompile.arrays import FloatArray, real_array
from qcompile.errors import CircuitError, MissingExtraError
from qcompile.execution.packed import pack_round
from qcompile.foreign import describe
from qcompile.interop.measured import measured_circuits, measured_in_order
from qcompile.interop.symbols import (
    Inputs,
    at,
    natural,
    not_affine,
    split,
    symbols,
    unknown,
)
from qcompile.interop.uploads import Uploads
from qcompile.ir import Angle, Program
from qcompile.ir.products import product
from qcompile.ir.wires import Wires
from qcompile.passes import Executable
from qcompile.qasm.gates import KNOWN_GATES, standard
from qcompile.qasm.modifiers import Unitary

_WITHOUT_EFFECT = ("barrier", "delay")
STANDARD_GATES = "qiskit.circuit.library.standard_gates"
_PROBES = (0.7390851332151607, -1.3247179572447460)
"""The points at which an angle is checked to be affine."""


def program_of(circuit: Any, inputs: Inputs = None) -> Program:
    """The program of a QuantumCircuit; see `Program.from_qiskit`."""
    return _read(circuit, inputs, products=False).program


def uploads_of(circuit: Any, inputs: Inputs = None) -> Uploads:
    """The same, with products of inputs and parameters; see `Ansatz.from_qiskit`."""
    return _read(circuit, inputs, products=True)


def _read(circuit: Any, inputs: Inputs, products: bool) -> Uploads:
    try:
        from qiskit.circuit import QuantumCircuit
    except ImportError as error:
        raise MissingExtraError("Reading a Qiskit circuit", "qiskit") from error
    if not isinstance(circuit, QuantumCircuit):
        raise CircuitError(
            f"{'Ansatz' if products else 'Program'}.from_qiskit takes a QuantumCircuit, "
            f"found {describe(circuit)}."
        )
    input_names, parameter_names = split(natural(p.name for p in circuit.parameters), inputs)
    names = symbols([*input_names, *parameter_names])
    reader = _Reader(names, products)
    reader.read(circuit, range(circuit.num_qubits), range(circuit.num_clbits))
    circuits, qubits = reader.wires.circuits(circuit.num_qubits)
    keys = {bit: reader.bits[qubit] for bit, qubit in enumerate(qubits) if qubit in reader.bits}
    order = measured_in_order(keys, sorted(range(len(qubits)), key=qubits.__getitem__))
    measured = measured_circuits(circuits, order)
    return Uploads.of(
        measured.circuits,
        {names[name]: name for name in input_names},
        {names[name]: name for name in parameter_names},
        observables=[(measured.bits[bit],) for bit in order],
    )


class _Reader:
    """The gates on the qubits, and the bit that each measured qubit is measured into."""

    def __init__(self, names: Mapping[str, str], products: bool):
        self.wires = Wires()
        self.bits: dict[int, int] = {}
        self._names, self._products = names, products

    def read(
        self, circuit: Any, qubits: Sequence[int], bits: Sequence[int], within: tuple[str, ...] = ()
    ) -> None:
        """Add the gates of `circuit` to these qubits; `within` names the gates it is part of."""
        for instruction in circuit.data:
            operands = [qubits[circuit.find_bit(q).index] for q in instruction.qubits]
            targets = [bits[circuit.find_bit(c).index] for c in instruction.clbits]
            self._add(instruction.operation, operands, targets, within)

    def _add(
        self, operation: Any, qubits: Sequence[int], bits: Sequence[int], within: tuple[str, ...]
    ) -> None:
        name = operation.name
        if name in _WITHOUT_EFFECT or not qubits:
            return
        where = at(name, "qubit", qubits, within)
        for qubit in qubits:
            if qubit in self.bits:
                raise CircuitError(
                    f"{where} comes after the measurement of qubit {qubit}.",
                    "A qubit is measured once, at the end; remove the first measurement.",
                )
        if name == "measure":
            self._measure(qubits[0], bits[0])
            return
        if (unitary := self._standard(operation)) is not None:
            self.wires.apply(unitary.steps, qubits)
        elif (definition := definition_of(operation)) is not None:
            self.read(definition, qubits, bits, (*within, name))
        else:
            raise unknown(name, where)

    def _standard(self, operation: Any) -> Unitary | None:
        """The unitary of a standard gate of Qiskit that files have too; None for any other."""
        home = getattr(operation, "base_class", type(operation)).__module__
        if not home.startswith(STANDARD_GATES) or operation.name not in KNOWN_GATES:
            return None
        angles = [angle_of(value, self._names, self._products) for value in operation.params]
        return standard(operation.name, angles)

    def _measure(self, qubit: int, bit: int) -> None:
        if bit in self.bits.values():
            raise CircuitError(
                f"measure of qubit {qubit} writes bit {bit}, which another qubit wrote already.",
                "Measure each qubit into a separate bit.",
            )
        self.bits[qubit] = bit


def definition_of(operation: Any) -> Any:
    """The circuit that defines an operation; None if there is none."""
    from qiskit.circuit import ControlFlowOp

    if isinstance(operation, ControlFlowOp):
        return None
    return getattr(operation, "definition", None)


def angle_of(value: Any, names: Mapping[str, str], products: bool) -> Angle:
    """The angle of a number or an affine ParameterExpression, bilinear too with `products`.

    Slopes are derivatives at 0; two probe points check that the expression has no other terms.
    """
    if not hasattr(value, "parameters"):
        return Angle.of(float(value))
    slopes: dict[Any, complex] = {}
    pairs: dict[frozenset[Any], complex] = {}
    for parameter in value.parameters:
        slope = _slope(value, parameter, value)
        if products and (others := getattr(slope, "parameters", ())):
            for other in others:
                if second := _number(_slope(slope, other, value), value):
                    pairs[frozenset((parameter, other))] = second
            slope = _value_at(slope, dict.fromkeys(others, 0.0))
        slopes[parameter] = _number(slope, value)
    if any(len(pair) == 1 for pair in pairs):
        raise not_affine(str(value))
    constant = _value_at(value, dict.fromkeys(slopes, 0.0))
    for probe in _PROBES:
        point = {p: probe * (i + 1) for i, p in enumerate(slopes)}
        parts = [constant, *(slope * point[p] for p, slope in slopes.items())]
        parts += [c * math.prod(point[p] for p in pair) for pair, c in pairs.items()]
        if abs(_value_at(value, point) - sum(parts)) > 1e-12 * sum(map(abs, parts)):
            raise not_affine(str(value))
    if any(number.imag for number in (constant, *slopes.values(), *pairs.values())):
        raise CircuitError(f"The angle {value} is not real.", "An angle is a real number.")
    symbols = {p: Angle.symbol(names[p.name]) for p in slopes}
    angle = Angle.of(constant.real)
    for parameter, slope in slopes.items():
        angle += symbols[parameter] * slope.real
    for (first, second), coefficient in pairs.items():
        angle += product(symbols[first], symbols[second]) * coefficient.real
    return angle


def _slope(value: Any, parameter: Any, angle: Any) -> Any:
    """The derivative of an expression of `angle`: a number, or an expression."""
    try:
        return value.gradient(parameter)
    except (TypeError, ValueError, RuntimeError) as error:
        raise not_affine(str(angle)) from error


def _number(value: Any, angle: Any) -> complex:
    try:
        return complex(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise not_affine(str(angle)) from error


def _value_at(value: Any, point: Mapping[Any, float]) -> complex:
    try:
        number = complex(value.bind(dict(point)))
    except (TypeError, ValueError, ZeroDivisionError, RuntimeError) as error:
        raise not_affine(str(value)) from error
    if not (math.isfinite(number.real) and math.isfinite(number.imag)):
        raise not_affine(str(value))
    return number


def circuits_of(
    executable: Executable,
    x: FloatArray | None = None,
    theta: FloatArray | None = None,
    *,
    measure: bool = True,
) -> list[Any]:
    """A QuantumCircuit for each round; see `Executable.to_qiskit`."""
    try:
        import qiskit  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("A Qiskit circuit", "qiskit") from error
    if (x is None) != (theta is None):
        raise CircuitError(
            f"{'theta' if x is None else 'x'} was given without {'x' if x is None else 'theta'}.",
            "Give both for circuits with numbers, or neither for circuits with parameters.",
        )
    angles = None
    if x is not None and theta is not None:
        inputs, trained = real_array(x), real_array(theta)
        if inputs is None or trained is None:
            raise CircuitError("x and theta are not arrays of real numbers.")
        angles = executable.bind(inputs[None], trained)
    circuits = []
    for index in range(executable.round_count):
        packed = pack_round(executable, index)
        circuit = packed.circuit
        if not packed.slots.size:
            circuit.global_phase = 0.0
        elif angles is not None:
            (parameters, values), *_ = packed.pub(angles)[1].items()
            circuit = circuit.assign_parameters(dict(zip(parameters, values[0], strict=True)))
        if not measure:
            circuit = circuit.remove_final_measurements(inplace=False)
        circuits.append(circuit)
    return circuits
