"""Place circuits of several qubits on a device's couplings, with Qiskit's layout and routing.

Qiskit sees a circuit once, as a skeleton: each run is one rz with a parameter, which it leaves as
it is. What it inserts, swaps and translated couplings, are couplings and gates that fuse with the
runs around them. Routes are remembered: a process places the same policy many times.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qcompile.arrays import IntArray
from qcompile.device import Device
from qcompile.errors import DeviceError, MissingExtraError
from qcompile.ir import Circuit, Gate, Program
from qcompile.ir.runs import Run, split
from qcompile.noise import unusable

if TYPE_CHECKING:
    from qiskit import QuantumCircuit
    from qiskit.transpiler import Target


_TRIES = 8
"""Routings of a circuit that needs swaps: their couplings differ by up to a half."""


class Routed(NamedTuple):
    """A circuit in a device's couplings, and its physical qubits (circuit.width,).

    Its first qubits are those of the source, in order, at the time of measurement; the others are
    only passed through.
    """

    circuit: Circuit
    qubits: IntArray

    def coupling_error(self, device: Device) -> float:
        """The sum of the errors of its couplings."""
        calibrations, qubits = device.coupling_calibrations, self.qubits.tolist()
        couplings = (gate for gate in self.circuit.gates if gate.is_coupling)
        return sum(
            calibrations[gate.name, qubits[gate.qubits[0]], qubits[gate.qubits[1]]].error
            for gate in couplings
        )


@dataclass(frozen=True)
class _Machine:
    """A device, equal to those with the same contents."""

    contents: str
    device: Device = field(compare=False)


def route(
    circuit: Circuit, device: Device, *, taken: Collection[int] = (), seed: int = 0
) -> Routed | None:
    """The circuit on free qubits of the device; None if none are connected well enough.

    Of the layouts without swaps the one with the least gate and readout error is taken, if there
    is one; otherwise the one of several routings whose couplings have the least error. The same
    seed gives the same result. Gates and couplings of any kind are allowed.

    Raises:
        DeviceError: the device has no couplings, or the circuit is wider than the device.
        MissingExtraError: Qiskit is not installed.
    """
    if not device.couplings:
        raise DeviceError(
            f"{device.name} has no couplings: it cannot run a circuit on {circuit.width} qubits.",
            "Use a device that has, such as fake_lima; `qcompile backends` lists them.",
        )
    if circuit.width > len(device.qubits):
        raise DeviceError(
            f"A circuit has {circuit.width} qubits, {device.name} has {len(device.qubits)}.",
            "Use a larger device.",
        )
    try:
        import qiskit  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("Placing circuits on several qubits", "qiskit") from error
    return _best(circuit, _Machine(device.to_json(), device), frozenset(taken), seed)


@lru_cache(maxsize=4096)
def _best(circuit: Circuit, machine: _Machine, taken: frozenset[int], seed: int) -> Routed | None:
    """The best of _TRIES routings, or the first one if it needs no swaps."""
    device = machine.device
    first = _route(circuit, device, taken, seed)
    if first is None or _couplings(first.circuit) == _couplings(circuit):
        return first
    others = (_route(circuit, device, taken, seed + k) for k in range(1, _TRIES))
    return min(filter(None, [first, *others]), key=lambda found: found.coupling_error(device))


def _couplings(circuit: Circuit) -> int:
    return sum(gate.is_coupling for gate in circuit.gates)


def _route(circuit: Circuit, device: Device, taken: frozenset[int], seed: int) -> Routed | None:
    """The circuit as Qiskit routes it with this seed."""
    from qiskit.transpiler import TranspilerError, generate_preset_pass_manager

    free = sorted(set(range(len(device.qubits))) - {*taken, *unusable(device)})
    if len(free) < circuit.width:
        return None
    target = _target(device, free)
    manager = generate_preset_pass_manager(1, target=target, seed_transpiler=seed)
    manager.optimization = None  # it would merge the runs
    runs, skeleton = split(Program((circuit,), circuit.symbols))
    ((_, parts),) = skeleton.circuits
    try:
        routed = manager.run(_skeleton(circuit.width, parts))
    except TranspilerError:
        return None
    found = _read(routed, circuit.width, runs.circuits)
    qubits = np.array(free)[found.qubits]
    qubits.setflags(write=False)  # routes are shared
    return Routed(found.circuit, qubits)


def _skeleton(width: int, parts: tuple[Run | Gate, ...]) -> QuantumCircuit:
    from qiskit import QuantumCircuit
    from qiskit.circuit import Parameter

    skeleton = QuantumCircuit(width, width)
    for part in parts:
        if isinstance(part, Run):
            skeleton.rz(Parameter(f"run{part.number}"), part.qubit)
        else:
            getattr(skeleton, part.name)(*part.qubits)
    skeleton.measure(range(width), range(width))
    return skeleton


def _target(device: Device, free: Sequence[int]) -> Target:
    """The device's gates on its free qubits and the couplings between them, with their errors.

    The target has only these qubits, numbered in order: Qiskit 2.6 panics where few of a target's
    qubits have gates.
    """
    from qiskit.circuit import Measure, Parameter
    from qiskit.circuit.library import CXGate, CZGate, ECRGate, RXGate, RZGate, SXGate, XGate
    from qiskit.transpiler import InstructionProperties, Target

    classes = {"sx": SXGate(), "x": XGate(), "cx": CXGate(), "cz": CZGate(), "ecr": ECRGate()}
    classes |= {"rz": RZGate(Parameter("angle")), "rx": RXGate(Parameter("angle"))}
    target = Target(num_qubits=len(free))
    qubits = [device.qubits[qubit] for qubit in free]
    for name in device.native.gates:
        errors = [qubit.gates.get(name) for qubit in qubits]
        properties = [InstructionProperties(error=each.error if each else 0.0) for each in errors]
        target.add_instruction(classes[name], {(q,): each for q, each in enumerate(properties)})
    name, place = device.coupling_gates[0], {qubit: number for number, qubit in enumerate(free)}
    couplings = {
        (place[each.qubits[0]], place[each.qubits[1]]): InstructionProperties(error=each.error)
        for each in device.couplings
        if each.gate == name and place.keys() >= set(each.qubits)
    }
    if couplings:  # Qiskit takes an empty dictionary as any two qubits
        target.add_instruction(classes[name], couplings)
    readout = [InstructionProperties(error=(qubit.p10 + qubit.p01) / 2) for qubit in qubits]
    target.add_instruction(Measure(), {(q,): each for q, each in enumerate(readout)})
    return target


def _read(routed: Any, width: int, runs: tuple[Circuit, ...]) -> Routed:
    """What Qiskit returned, with the runs in their places."""
    index = {bit: number for number, bit in enumerate(routed.qubits)}
    measured = [-1] * width
    gates: list[Gate] = []
    for instruction in routed.data:
        qubits = tuple(index[bit] for bit in instruction.qubits)
        name, angles = instruction.operation.name, instruction.operation.params
        if name == "measure":
            measured[routed.find_bit(instruction.clbits[0]).index] = qubits[0]
        elif angles and getattr(angles[0], "parameters", None):
            number = int(str(angles[0]).removeprefix("run"))
            gates += [gate.on(*qubits) for gate in runs[number].gates]
        elif name != "barrier":
            gates.append(Gate.of(name, float(angles[0]) if angles else None, qubits=qubits))
    passed = sorted({qubit for gate in gates for qubit in gate.qubits} - set(measured))
    physical = [*measured, *passed]
    local = {qubit: number for number, qubit in enumerate(physical)}
    moved = (gate.on(*(local[qubit] for qubit in gate.qubits)) for gate in gates)
    return Routed(Circuit(tuple(moved), len(physical)), np.array(physical))
