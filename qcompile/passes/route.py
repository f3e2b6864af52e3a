"""Place circuits of several qubits on a device's couplings, with Qiskit's layout and routing.

Qiskit sees a circuit once, as a skeleton: each run is one rz with a parameter, which it leaves as
it is. What it inserts, swaps and translated couplings, are couplings and gates that fuse with the
runs around them. Routes are remembered: a process places the same policy many times.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qcompile.arrays import IntArray
from qcompile.device import Device
from qcompile.errors import DeviceError, MissingExtraError
from qcompile.ir import Circuit, Gate
from qcompile.ir.connected import connected
from qcompile.ir.runs import Run
from qcompile.noise import unusable
from qcompile.passes.fences import Fence, Part, fenced

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
    circuit: Circuit,
    device: Device,
    *,
    taken: Collection[int] = (),
    on: Sequence[int] | None = None,
    fences: Sequence[Collection[str]] = (),
    seed: int = 0,
) -> Routed | None:
    """The circuit on free qubits of the device; None if none are connected well enough.

    Of the layouts without swaps the one with the least gate and readout error is taken, if there
    is one; otherwise the one of several routings whose couplings have the least error. With `on`
    qubit k is physical qubit on[k], whatever is `taken`, and there are no swaps. The gates of
    `fences` (`passes.fences`) stay together. The same seed gives the same result. Gates and
    couplings of any kind are allowed.

    Raises:
        DeviceError: the device has no couplings, the circuit is wider than the device, or its
            couplings between qubits `on` are missing.
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
    together = tuple(map(frozenset, fences))
    if on is not None:
        _require_coupled(circuit, device, on)
        return _route(circuit, device, sorted(on), together, seed, on)
    machine = _Machine(device.to_json(), device)
    return _best(circuit, machine, frozenset(taken), together, seed)


@lru_cache(maxsize=4096)
def _best(
    circuit: Circuit,
    machine: _Machine,
    taken: frozenset[int],
    fences: tuple[frozenset[str], ...],
    seed: int,
) -> Routed | None:
    """The best routing on connected free qubits: one without swaps, or the best of _TRIES."""
    device = machine.device
    free = set(range(len(device.qubits))) - {*taken, *unusable(device)}
    couplings = [each.qubits for each in device.couplings if set(each.qubits) <= free]
    groups = [g for g in connected(sorted(free), couplings) if len(g) >= circuit.width]

    def tried(seed: int) -> list[Routed]:
        found = (_route(circuit, device, group, fences, seed) for group in groups)
        return [routed for routed in found if routed is not None]

    first = tried(seed)
    found = [routed for routed in first if _couplings(routed.circuit) == _couplings(circuit)]
    if not found:
        found = [*first, *(routed for k in range(1, _TRIES) for routed in tried(seed + k))]
    return min(found, key=lambda routed: routed.coupling_error(device), default=None)


def _couplings(circuit: Circuit) -> int:
    return sum(gate.is_coupling for gate in circuit.gates)


def _route(
    circuit: Circuit,
    device: Device,
    qubits: Sequence[int],
    fences: Sequence[Collection[str]],
    seed: int,
    on: Sequence[int] | None = None,
) -> Routed | None:
    """The circuit as Qiskit routes it with this seed on these qubits, in ascending order.

    Qiskit knows of no others: it may end in a panic where qubits are not connected.
    """
    from qiskit.transpiler import TranspilerError, generate_preset_pass_manager

    fixed: dict[str, Any] = {}
    if on is not None:
        fixed = {"initial_layout": [qubits.index(q) for q in on], "routing_method": "none"}
    target = _target(device, qubits)
    manager = generate_preset_pass_manager(1, target=target, seed_transpiler=seed, **fixed)
    manager.optimization = None  # it would merge the runs
    runs, parts = fenced(circuit, fences)
    try:
        routed = manager.run(_skeleton(circuit.width, parts))
    except TranspilerError:
        return None
    fence_of = {part.number: part for part in parts if isinstance(part, Fence)}
    return _read(routed, circuit.width, runs, fence_of, qubits)


def _require_coupled(circuit: Circuit, device: Device, on: Sequence[int]) -> None:
    """Check that every coupling of the circuit is one of the device, in either direction."""
    name = device.coupling_gates[0]
    pairs = {frozenset(each.qubits) for each in device.couplings if each.gate == name}
    for gate in circuit.gates:
        if gate.is_coupling:
            control, target = (on[qubit] for qubit in gate.qubits)
            if frozenset((control, target)) not in pairs:
                listed = " ".join(sorted(f"{min(pair)}-{max(pair)}" for pair in pairs)[:12])
                raise DeviceError(
                    f"{device.name} does not couple qubits {control} and {target}, "
                    f"which {gate.name} connects.",
                    f"It couples {listed}{' ...' if len(pairs) > 12 else ''}.",
                    "Name coupled qubits, or declare a register: its qubits are placed for you.",
                )


def _skeleton(width: int, parts: Sequence[Part]) -> QuantumCircuit:
    from qiskit import QuantumCircuit
    from qiskit.circuit import Parameter
    from qiskit.circuit.library import Barrier

    skeleton = QuantumCircuit(width, width)
    for part in parts:
        if isinstance(part, Run):
            skeleton.rz(Parameter(f"run{part.number}"), part.qubit)
        elif isinstance(part, Fence):
            skeleton.append(Barrier(len(part.gates), label=str(part.number)), part.qubits)
        else:
            getattr(skeleton, part.name)(*part.qubits)
    skeleton.measure(range(width), range(width))
    return skeleton


def _target(device: Device, qubits: Sequence[int]) -> Target:
    """The device's gates on these qubits and the couplings between them, with their errors.

    Qubit k of the target is `qubits[k]`.
    """
    from qiskit.circuit import Measure, Parameter
    from qiskit.circuit.library import CXGate, CZGate, ECRGate, RXGate, RZGate, SXGate, XGate
    from qiskit.transpiler import InstructionProperties, Target

    classes = {"sx": SXGate(), "x": XGate(), "cx": CXGate(), "cz": CZGate(), "ecr": ECRGate()}
    classes |= {"rz": RZGate(Parameter("angle")), "rx": RXGate(Parameter("angle"))}
    place = {qubit: index for index, qubit in enumerate(qubits)}
    target = Target(num_qubits=len(qubits))
    for name in device.native.gates:
        gates = [device.qubits[qubit].gates.get(name) for qubit in qubits]
        errors = [gate.error if gate else 0.0 for gate in gates]
        target.add_instruction(
            classes[name],
            {(k,): InstructionProperties(error=e) for k, e in enumerate(errors)},
        )
    name = device.coupling_gates[0]
    target.add_instruction(
        classes[name],
        {
            (place[each.qubits[0]], place[each.qubits[1]]): InstructionProperties(error=each.error)
            for each in device.couplings
            if each.gate == name and set(each.qubits) <= place.keys()
        },
    )
    readout = [(device.qubits[q].p10 + device.qubits[q].p01) / 2 for q in qubits]
    target.add_instruction(
        Measure(), {(k,): InstructionProperties(error=e) for k, e in enumerate(readout)}
    )
    return target


def _read(
    routed: Any,
    width: int,
    runs: Sequence[Circuit],
    fences: Mapping[int, Fence],
    physical: Sequence[int],
) -> Routed:
    """What Qiskit returned for qubits that are `physical`, with the runs and fences in place."""
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
        elif name == "barrier":
            fence = fences[int(label)].gates if (label := instruction.operation.label) else ()
            gates += [gate.on(qubit) for gate, qubit in zip(fence, qubits, strict=False)]
        else:
            gates.append(Gate.of(name, float(angles[0]) if angles else None, qubits=qubits))
    passed = sorted({qubit for gate in gates for qubit in gate.qubits} - set(measured))
    used = [*measured, *passed]
    local = {qubit: number for number, qubit in enumerate(used)}
    moved = (gate.on(*(local[qubit] for qubit in gate.qubits)) for gate in gates)
    placed = np.array([physical[q] for q in used])
    placed.setflags(write=False)  # routes are shared
    return Routed(Circuit(tuple(moved), len(used)), placed)
