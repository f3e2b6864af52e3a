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
from qcompile.interop.symbols import (
    Inputs,
    at,
    entangles,
    measured_in_order,
    natural,
    not_affine,
    split,
    symbols,
    unknown,
)
from qcompile.interop.uploads import Uploads
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.ir.products import product
from qcompile.passes import Executable
from qcompile.qasm.gates import KNOWN_GATES, standard

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
    reader = _Reader(circuit.num_qubits, names, products)
    reader.read(circuit, range(circuit.num_qubits), range(circuit.num_clbits))
    order = measured_in_order(reader.bits, circuit.num_qubits)
    return Uploads.of(
        [Circuit(tuple(reader.gates[qubit])) for qubit in order],
        {names[name]: name for name in input_names},
        {names[name]: name for name in parameter_names},
    )


class _Reader:
    """The gates of each qubit, and the bit that each measured qubit is measured into."""

    def __init__(self, qubits: int, names: Mapping[str, str], products: bool):
        self.gates: list[list[Gate]] = [[] for _ in range(qubits)]
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
        definition = _definition(operation)
        if len(qubits) == 1 and name in KNOWN_GATES and definition is None:
            angles = [_angle(value, self._names, self._products) for value in operation.params]
            self.gates[qubits[0]] += standard(name, angles)
        elif definition is not None:
            self.read(definition, qubits, bits, (*within, name))
        elif len(qubits) > 1 and _is_gate(operation):
            raise entangles(name, where)
        else:
            raise unknown(name, where)

    def _measure(self, qubit: int, bit: int) -> None:
        if bit in self.bits.values():
            raise CircuitError(
                f"measure of qubit {qubit} writes bit {bit}, which another qubit wrote already.",
                "Measure each qubit into a separate bit.",
            )
        self.bits[qubit] = bit


def _is_gate(operation: Any) -> bool:
    from qiskit.circuit import Gate as QiskitGate

    return isinstance(operation, QiskitGate)


def _definition(operation: Any) -> Any:
    """The circuit that defines an operation; None for standard gates and undefined ones."""
    from qiskit.circuit import ControlFlowOp

    home = getattr(operation, "base_class", type(operation)).__module__
    if home.startswith(STANDARD_GATES) or isinstance(operation, ControlFlowOp):
        return None
    return getattr(operation, "definition", None)


def _angle(value: Any, names: Mapping[str, str], products: bool) -> Angle:
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
