"""Fences: gates that routing keeps side by side."""

from __future__ import annotations

import numpy as np
import pytest
from wide import ANY, operator, random_circuit

from qcompile.device import load_device
from qcompile.ir import Angle, Circuit, Gate
from qcompile.ir.runs import Run
from qcompile.passes.fences import Fence, fenced
from qcompile.passes.route import route

SYMBOLS = {"x0": 0.3, "x1": -1.1, "theta0": 0.7, "theta1": 2.0}


def test_parts_of_a_fence_stay_together() -> None:
    """The gates of the second pair come after those of the first in the list, not in time."""
    text = "h@0 cx@0,1 rz(a)@0 rz(b)@1 cx@1,0 x@2 cx@2,3 cx@2,3 rz(c)@2 s@2 rz(d)@3 cx@3,2"
    runs, parts = fenced(Circuit.parse(text, 4), [{"z"}, {"a", "b", "c", "d"}])
    words = [f"fence {p.qubits}" if isinstance(p, Fence) else str(p) for p in parts]
    assert words == [
        *("Run(qubit=0, number=0)", "cx@0,1", "Run(qubit=2, number=1)", "cx@2,3", "cx@2,3"),
        *("fence (0, 1, 2, 3)", "cx@1,0", "Run(qubit=2, number=2)", "cx@3,2"),
    ]
    assert list(map(str, runs)) == ["h", "x", "s"]


def test_without_fences_parts_are_runs_and_couplings() -> None:
    runs, parts = fenced(Circuit.parse("h@0 cx@0,1 rz(a)@0", 2), [{"z"}])
    assert list(map(str, runs)) == ["h", "rz(a)"]
    assert list(map(type, parts)) == [Run, Gate, Run]


def with_fences(circuit: Circuit, rng: np.random.Generator) -> tuple[Circuit, list[set[str]]]:
    """The circuit with a fence of some qubits after some of its gates."""
    gates: list[Gate] = []
    fences: list[set[str]] = []
    for gate in circuit.gates:
        gates.append(gate)
        if rng.random() < 0.2:
            some = rng.choice(circuit.width, int(rng.integers(2, circuit.width + 1)), False)
            names = {f"f{len(fences)}_{qubit}": int(qubit) for qubit in some}
            gates += [Gate("rz", Angle.symbol(name), (qubit,)) for name, qubit in names.items()]
            fences.append({*names})
    return Circuit(tuple(gates), circuit.width), fences


def in_parts(circuit: Circuit, fences: list[set[str]]) -> Circuit:
    runs, parts = fenced(circuit, fences)
    gates: list[Gate] = []
    for part in parts:
        if isinstance(part, Run):
            gates += [gate.on(part.qubit) for gate in runs[part.number].gates]
        else:
            gates += part.gates if isinstance(part, Fence) else [part]
    return Circuit(tuple(gates), circuit.width)


@pytest.mark.parametrize("seed", range(8))
def test_fences_come_through_routing_in_one_piece(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width = int(rng.integers(2, 6))
    circuit, fences = with_fences(random_circuit(rng, ANY, width), rng)
    names = [name for fence in fences for name in fence]
    values = SYMBOLS | {name: 0.1 + 0.2 * number for number, name in enumerate(sorted(names))}
    wanted = operator(circuit, values)
    np.testing.assert_allclose(operator(in_parts(circuit, fences), values), wanted, atol=1e-10)
    routed = route(circuit, load_device("fake_jakarta"), fences=fences)
    assert routed is not None
    order = [gate.angle.symbols[0] for gate in routed.circuit.gates if gate.angle in angles(names)]
    assert sorted(order) == sorted(names)
    for fence in fences:
        first = min(order.index(name) for name in fence)
        assert {*order[first : first + len(fence)]} == fence
    found = np.abs(operator(routed.circuit, values)[:, 0]) ** 2
    probabilities = found.reshape(-1, 2**width).sum(axis=0)
    np.testing.assert_allclose(probabilities, np.abs(wanted[:, 0]) ** 2, atol=1e-10)


def angles(names: list[str]) -> list[Angle | None]:
    return [Angle.symbol(name) for name in names]
