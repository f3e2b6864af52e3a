"""Qiskit circuits whose gates on one qubit are fused once, and bound for a whole batch at a time.

Source: qiskit.primitives, SamplerPub, EstimatorPub, BindingsArray and ObservablesArray.
"""

from __future__ import annotations

import math
from typing import Any, Literal, get_args

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import IDEAL
from qcompile.errors import CircuitError, MissingExtraError
from qcompile.foreign import describe
from qcompile.interop.late.instructions import folded, read_instructions
from qcompile.interop.late.operations import is_standard
from qcompile.interop.late.template import assembled
from qcompile.interop.late.values import expression_values, parameter_values, read_pub
from qcompile.ir.table import AngleTable, are_large
from qcompile.native import RX, SX, NativeGates
from qcompile.passes import Executable, lower
from qcompile.passes.drop_unobservable import without_outer_rz

Keep = Literal["state", "z"]


def late(isa_circuit: Any, target: Any = None, keep: Keep = "state") -> LateCircuit:
    """The circuit with the gates on each qubit between two couplings fused, whatever its angles.

    `isa_circuit` is a QuantumCircuit after Qiskit's transpiler, with any gates, bits and control
    flow; what is no gate on one qubit stays where it is. A run is rz sx rz sx rz or shorter, or rz
    rx rz where `target` (a Target or BackendV2) has rx; without a target, where the circuit has rx
    and no sx. `keep` is what stays the same from `|0>`, up to global phase: the "state", or the
    distribution of a measurement in "z" of all qubits, which needs no rz at the end.

    Raises:
        CircuitError: not a QuantumCircuit, no such `keep`, an angle is not real, or the target has
            other gates than the circuit.
        MissingExtraError: Qiskit is not installed.
    """
    try:
        from qiskit.circuit import QuantumCircuit
    except ImportError as error:
        raise MissingExtraError("Late binding of a Qiskit circuit", "qiskit") from error
    if not isinstance(isa_circuit, QuantumCircuit):
        raise CircuitError(f"late takes a QuantumCircuit, found {describe(isa_circuit)}.")
    if keep not in get_args(Keep):
        raise CircuitError(f"There is no keep={keep!r}.", 'It is "state" or "z".')
    return LateCircuit(isa_circuit, _native_gates(isa_circuit, target), keep)


class LateCircuit:
    """A circuit as a template of fused runs, and the angles of the template for any values.

    `circuit` is the template: a QuantumCircuit on the same qubits and bits, with the same layout,
    whose parameters are the vector `late`, in order, and whose global phase is 0. `source` is the
    circuit it was made of, `keep` what it keeps the same.
    """

    def __init__(self, source: Any, native: NativeGates, keep: Keep):
        self._given, self._native = source, native
        self.source, self.keep = source.copy(), keep
        instructions = read_instructions(source)
        program = instructions.program
        is_open = [keep == "z" or last for last in _measured_last(source)]
        lowered = without_outer_rz(lower(program, 1, native), [*is_open, False])
        places = np.arange(program.bits), np.zeros(1, dtype=np.intp)
        self._executable = Executable(program, lowered, IDEAL, 1, *places)
        self._expressions = expression_values(instructions)
        self._interactions = AngleTable(instructions.interactions, instructions.symbols, ())
        self._slots = self._executable.open_slots
        self.circuit, self._passed = assembled(source, instructions, self._executable.template())
        self._parameters = tuple(self.circuit.parameters)

    def angles(self, values: Any) -> FloatArray:
        """The template's angles (..., T) for values (..., P) of the source's parameters.

        P are the source's `parameters`, in Qiskit's order. A BindingsArray, or a mapping that is
        taken for one, gives them by name. Angles of rzz are in [0, pi/2], outside of control flow.

        Raises:
            CircuitError: the values have another shape, are not real, or give an angle that is not
                a finite number.
        """
        array = parameter_values(values, self.source)
        *outer, count = array.shape
        flat = array.reshape(math.prod(outer), count)
        x = np.concatenate([flat, self._expressions(flat)], axis=1)
        if not np.isfinite(x).all():
            raise CircuitError("An angle is not a finite number.", "Check the values.")
        none = np.zeros(0)
        large = are_large(x, none, self._interactions.largest)
        open_angles = np.broadcast_to(
            self._interactions(x, none, large=large), (len(x), self._interactions.constant.size)
        )
        inside, about_x, about_z = folded(open_angles)
        turns = np.stack([about_x, about_z], axis=2).reshape(len(x), 2 * inside.shape[1])
        bound = self._executable.bind(np.concatenate([x, turns], axis=1), none)
        found = np.concatenate([bound[:, self._slots], inside, flat[:, self._passed]], axis=1)
        return found.reshape(*outer, found.shape[1])

    def pub(self, pub: Any) -> Any:
        """The PUB of the template for a PUB of the source, a SamplerPub or an EstimatorPub.

        `pub` is one of these, or a tuple that Qiskit takes for one: (circuit, values, shots) or
        (circuit, observables, values, precision), or the circuit alone.

        Raises:
            CircuitError: it has another circuit, Qiskit cannot read it, or its observables are not
                products of Z though only the distribution in Z is kept.
        """
        from qiskit.primitives.containers import EstimatorPub, SamplerPub
        from qiskit.primitives.containers.bindings_array import BindingsArray

        read = read_pub(pub)
        if not self._is_source(read.circuit):
            raise CircuitError(
                "The PUB has another circuit than the one that is bound late.",
                "Use the circuit that late() was given, after transpilation.",
            )
        values = read.parameter_values
        angles = self.angles(values.as_array(read.circuit.parameters))
        named = {self._parameters: angles} if self._parameters else None
        bound = BindingsArray(named, shape=values.shape)
        if isinstance(read, SamplerPub):
            return SamplerPub(self.circuit, bound, read.shots)
        self._require_z(read.observables)
        return EstimatorPub(self.circuit, read.observables, bound, read.precision)

    def map_observables(self, observables: Any) -> Any:
        """Observables on the qubits before the layout, as ones on the template's qubits.

        A Pauli or SparsePauliOp stays one; anything else becomes an ObservablesArray.

        Raises:
            CircuitError: Qiskit cannot read them, or they have other qubits than the circuit.
        """
        from qiskit.exceptions import QiskitError
        from qiskit.primitives.containers import ObservablesArray

        circuit = self.circuit
        try:
            if not hasattr(observables, "apply_layout"):
                observables = ObservablesArray.coerce(observables)
            return observables.apply_layout(circuit.layout, num_qubits=circuit.num_qubits)
        except (ValueError, TypeError, QiskitError) as error:
            raise CircuitError(f"Qiskit cannot map these observables: {error}") from error

    def _is_source(self, circuit: Any) -> bool:
        """Whether it is the given circuit, with nothing added since, or one equal to it then."""
        is_given = circuit is self._given and len(circuit.data) == len(self.source.data)
        return is_given or bool(circuit == self.source)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as what it was made of, because functions of expressions cannot be pickled."""
        return LateCircuit, (self.source, self._native, self.keep)

    def _require_z(self, observables: Any) -> None:
        if self.keep == "state":
            return
        for observable in observables.ravel().tolist():
            for letters in observable:
                if not set(letters) <= set("IZ01"):
                    raise CircuitError(
                        f"The observable {letters} is not a product of Z.",
                        'keep="z" keeps the distribution in Z alone; use keep="state".',
                    )

    def __repr__(self) -> str:
        return (
            f"LateCircuit({self.circuit.num_qubits} qubits, {len(self.source.parameters)} "
            f"parameters, {len(self._parameters)} angles, keeps {self.keep})"
        )


def _native_gates(circuit: Any, target: Any) -> NativeGates:
    """The gates that runs are made of, those of the target or of the circuit itself."""
    used = {instruction.operation.name for instruction in circuit.data}
    if target is None:
        return RX if "rx" in used and "sx" not in used else SX
    target = getattr(target, "target", target)
    names = getattr(target, "operation_names", None)
    if names is None:
        raise CircuitError(f"target= takes a Target or a BackendV2, found {describe(target)}.")
    if target.num_qubits is not None and circuit.num_qubits > target.num_qubits:
        raise CircuitError(
            f"The circuit has {circuit.num_qubits} qubits; the target has {target.num_qubits}.",
            "Transpile it for the target first.",
        )
    for instruction in circuit.data:
        operation = instruction.operation
        places = tuple(circuit.find_bit(qubit).index for qubit in instruction.qubits)
        known = target.instruction_supported(operation.name, places)
        if len(places) == 2 and operation.name != "barrier" and not known:
            raise CircuitError(
                f"The target has no {operation.name} on qubits {places[0]} and {places[1]}.",
                "Transpile the circuit for the target first.",
            )
    try:
        return NativeGates.of(tuple(names))
    except ValueError as error:
        raise CircuitError(
            f"The target has the gates {' '.join(sorted(names))}.",
            "Late binding needs rz, sx and x, or rz and rx.",
        ) from error


def _measured_last(circuit: Any) -> list[bool]:
    """Whether each qubit ends with a measurement."""
    last = [False] * circuit.num_qubits
    for instruction in circuit.data:
        if not is_standard(instruction.operation, "barrier"):
            is_measured = is_standard(instruction.operation, "measure")
            for qubit in instruction.qubits:
                last[circuit.find_bit(qubit).index] = is_measured
    return last
