"""The results of the levels: gate counts, small circuits before and after, and placement."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.quantum_info import Statevector

from qcompile.device import IDEAL, Device, Qubit, load_device
from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.native import RX, SX, NativeGates
from qcompile.passes import LEVELS, compile, lower, pipeline
from qcompile.passes.drop_unobservable import DropUnobservable
from qcompile.passes.fuse_rotations import FuseRotations
from qcompile.passes.merge_rotations import MergeRotations
from qcompile.passes.place import place
from qcompile.passes.to_native import ToNative
from qcompile.passes.to_rotations import ToRotations

PAPER = "h ry(x0) rz(x0) ry(theta0)"
UPLOADED = " ".join(f"ry(x0) rz(x0) ry(theta{i})" for i in range(3))
RX_DEVICE = Device(
    name="fractional",
    source="by hand",
    basis_gates=("rz", "rx"),
    qubits=(Qubit(t1_us=100, t2_us=100, p10=0.01, p01=0.01),),
)


def program(*texts: str) -> Program:
    return Program.of(map(Circuit.parse, texts), inputs=2, parameters=3)


def counts(text: str, level: int, native: NativeGates = SX) -> Counter[str]:
    (circuit,) = lower(program(text), level, native).circuits
    return Counter(gate.name for gate in circuit.gates)


@pytest.mark.parametrize("text", [PAPER, f"h {UPLOADED}", " ".join([PAPER] * 3)])
def test_symbolic_circuits_become_two_sx_one_rz(text: str) -> None:
    assert counts(text, 2) == {"sx": 2, "rz": 1}
    assert counts(text, 2, RX) == {"rx": 1}
    assert counts(text, 1) == {"sx": 2, "rz": 3}
    assert counts(text, 1, RX) == {"rx": 1, "rz": 2}


def test_parallel_copies_each_become_two_sx_one_rz() -> None:
    texts = [f"h ry(x{i}) rz(x{i}) ry(theta{copy})" for i in range(2) for copy in range(3)]
    executable = compile(program(*texts))
    assert executable.gate_counts() == [Counter(sx=2, rz=1)] * 6
    assert executable.slot_positions.tolist() == [0] * 6
    assert executable.bind(np.zeros((4, 2)), np.zeros(3)).shape == (4, 6)


def test_level_0_translates_gate_by_gate() -> None:
    # h is rz sx rz, each ry is sx rz sx rz, rz is itself.
    (circuit,) = lower(program(PAPER), 0, SX).circuits
    assert str(circuit) == (
        "rz(pi/2) sx rz(pi/2) sx rz(x0+pi) sx rz(pi) rz(x0) sx rz(theta0+pi) sx rz(pi)"
    )


@pytest.mark.parametrize(
    ("text", "level", "native", "gates"),
    [
        # <Z> = 0, -1, +1 from |0>.
        ("h", 2, SX, {"sx": 1}),
        ("ry(0.3) ry(pi/2-0.3)", 2, SX, {"sx": 1}),
        ("ry(-pi/2) rz(0.7)", 2, SX, {"sx": 1}),
        ("h rz(pi) h", 2, SX, {"x": 1}),
        ("sx sx", 2, SX, {"x": 1}),
        ("y", 2, SX, {"x": 1}),
        ("h h", 2, SX, {}),
        ("s t rz(0.3)", 2, SX, {}),
        ("x ry(pi)", 2, SX, {}),
        ("", 2, SX, {}),
        ("rz(x0) t rz(theta0)", 2, SX, {}),
        # The unitary.
        ("h h", 1, SX, {}),
        ("sx sxdg", 1, SX, {}),
        ("ry(x0) ry(-x0)", 1, SX, {}),
        ("s t rz(0.3)", 1, SX, {"rz": 1}),
        ("h x h", 1, SX, {"rz": 1}),
        ("rz(x0) t rz(theta0)", 1, SX, {"rz": 1}),
        ("x", 1, SX, {"x": 1}),
        ("sx", 1, SX, {"sx": 1}),
        ("h", 2, RX, {"rx": 1}),
        ("y", 2, RX, {"rx": 1}),
        ("h h", 2, RX, {}),
        ("h h", 1, RX, {}),
        ("rx(x0)", 1, RX, {"rx": 1}),
    ],
)
def test_special_circuits(
    text: str, level: int, native: NativeGates, gates: dict[str, int]
) -> None:
    assert counts(text, level, native) == gates


def random_texts(count: int, gates: list[str], seed: int) -> list[str]:
    rng = np.random.default_rng(seed)
    return [" ".join(rng.choice(gates, rng.integers(0, 9))) for _ in range(count)]


def test_clifford_circuits_by_their_expectation() -> None:
    """<Z> = 0, -1, +1 by Qiskit's statevector: exactly one sx, exactly one x, nothing."""
    gates = ["x", "y", "z", "h", "s", "sdg", "sx", "sxdg"]
    texts = random_texts(400, gates, seed=1)
    lowered = lower(program(*texts), 2, SX)
    seen = set()
    for text, circuit in zip(texts, lowered.circuits, strict=True):
        built = QuantumCircuit(1)
        for name in text.split():
            getattr(built, name)(0)
        chance = Statevector(built).probabilities()
        z = round(chance[0] - chance[1])
        assert str(circuit) == {0: "sx", -1: "x", 1: ""}[z], text
        seen.add(z)
    assert seen == {-1, 0, 1}


@pytest.mark.parametrize("symbolic", [False, True])
def test_random_circuits_never_exceed_the_maxima(symbolic: bool) -> None:
    angles = ["0.3", "-2.2", "pi/2", "pi", *(["x0", "x1+theta0", "2*theta1-1"] if symbolic else [])]
    gates = [*FIXED_GATES, *(f"{name}({angle})" for name in ROTATION_GATES for angle in angles)]
    many = program(*random_texts(600, gates, seed=2))
    most = {
        (1, SX): {"sx": 2, "rz": 3, "x": 1},
        (2, SX): {"sx": 2, "rz": 1, "x": 1},
        (1, RX): {"rx": 1, "rz": 2},
        (2, RX): {"rx": 1},
    }
    for (level, native), limits in most.items():
        for before, after in zip(many.circuits, lower(many, level, native).circuits, strict=True):
            found = Counter(gate.name for gate in after.gates)
            assert all(number <= limits.get(name, 0) for name, number in found.items()), before
            assert not (found["x"] and found["sx"]), before


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("ry(x0) ry(theta0)", "ry(theta0+x0)"),
        ("rz(x0) rz(-x0)", ""),
        ("rz(0.5*x0) rz(0.5*x0) ry(0.1)", "rz(x0) ry(0.1)"),
        # X Rz(a) = Rz(-a) X: a - a = 0.
        ("rz(x0) x rz(x0)", "x"),
        ("rz(x0) x rz(theta0)", "x rz(theta0-x0)"),
        ("ry(x0) x ry(x0+theta0)", "x ry(theta0)"),
        # X commutes with Rx: there is nothing to reverse.
        ("rx(x0) x rx(x0)", "rx(x0) x rx(x0)"),
        ("ry(x0) rz(pi) ry(theta0)", "rz(pi) ry(theta0-x0)"),
        ("rz(x0) ry(pi) rz(x0) ry(theta0)", "ry(theta0+pi)"),
        ("x x", ""),
        ("x rz(2*pi) x", ""),
        ("ry(x0) x x ry(x0)", "ry(2.0*x0)"),
        ("h h", "h h"),
        ("ry(x0) rz(0) ry(x1)", "ry(x0+x1)"),
        ("rz(3*pi/2)", "rz(-pi/2)"),
        ("rz(-pi)", "rz(pi)"),
        ("rz(x0+2*pi)", "rz(x0)"),
        ("ry(x0) rz(x1) ry(-x0)", "ry(x0) rz(x1) ry(-x0)"),
    ],
)
def test_merging(before: str, after: str) -> None:
    (merged,) = MergeRotations().apply(program(before)).circuits
    assert str(merged) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("rz(x0) z sx rz(x0) sx s", "sx rz(x0) sx"),
        ("id rz(x0) id p(theta0)", ""),
        ("t x tdg", "x"),
        ("ry(x0)", "ry(x0)"),
    ],
)
def test_dropping(before: str, after: str) -> None:
    (dropped,) = DropUnobservable().apply(program(before)).circuits
    assert str(dropped) == after


@pytest.mark.parametrize(
    ("before", "native", "after"),
    [
        ("h", SX, "rz(pi/2) sx rz(pi/2)"),
        ("ry(x0)", SX, "sx rz(x0+pi) sx rz(pi)"),
        ("ry(pi/2)", SX, "rz(-pi/2) sx rz(pi/2)"),
        ("rx(pi)", SX, "rz(-pi/2) x rz(-pi/2)"),
        ("y", SX, "rz(pi) x"),
        ("id", SX, "id"),
        ("id h id", RX, "id rz(pi/2) rx(pi/2) rz(pi/2) id"),
        ("p(x0)", SX, "rz(x0)"),
        ("x sx", SX, "x sx"),
        ("ry(x0)", RX, "rz(-pi/2) rx(x0) rz(pi/2)"),
        ("rx(x0)", RX, "rx(x0)"),
        ("t", RX, "rz(pi/4)"),
    ],
)
def test_native_gates(before: str, native: NativeGates, after: str) -> None:
    (made,) = ToNative(native).apply(program(before)).circuits
    assert str(made) == after


def test_the_paper_s_circuit_as_text() -> None:
    lowered = lower(program(PAPER), 2, SX)
    assert str(lowered) == (
        "inputs x0 x1\n"
        "parameters theta0 theta1 theta2\n"
        "0: sx rz(polar0+pi) sx\n"
        "where polar0 = polar{rz(pi) ry(x0+pi/2) rz(x0) ry(theta0)}"
    )


def test_new_symbols_do_not_collide() -> None:
    taken = Program((Circuit.parse("ry(polar0) rz(polar0) ry(first0) rz(polar0)"),),
                    ("polar0",), ("first0",))  # fmt: skip
    lowered = lower(taken, 1, SX)
    assert [late.name for late in lowered.late_angles] == ["_first0", "_polar0", "_last0"]
    assert compile(taken, level=1).bind(np.ones((2, 1)), np.ones(1)).shape == (2, 3)


@pytest.mark.parametrize("step", [MergeRotations(), DropUnobservable(), ToRotations()])
def test_passes_are_idempotent(step) -> None:
    angles = ["0.3", "pi", "-pi/2", "x0", "x0+theta0", "-x0"]
    gates = [*FIXED_GATES, *(f"{name}({angle})" for name in ROTATION_GATES for angle in angles)]
    few = ["x", "rz(x0)", "ry(x0)", "rx(pi)", "ry(pi)", "rz(pi)", "rz(-x0)", "rx(x0)"]
    once = step.apply(program(*random_texts(500, gates, seed=3), *random_texts(500, few, seed=4)))
    assert str(step.apply(once)) == str(once)


def test_fusing_is_idempotent() -> None:
    gates = ["rz(0.3)", "ry(x0)", "rz(theta0)", "ry(1.2)"]
    once = FuseRotations().apply(program(*random_texts(100, gates, seed=6)))
    assert str(FuseRotations().apply(once)) == str(once)


@pytest.mark.parametrize("device", [IDEAL, RX_DEVICE, load_device("fake_lima")])
@pytest.mark.parametrize("level", LEVELS)
def test_compiling_keeps_its_source(level: int, device: Device) -> None:
    source = program(PAPER, "x", UPLOADED)
    text = str(source)
    executable = compile(source, device, level)
    assert executable.source is source
    assert str(source) == text
    assert {g.name for c in executable.native.circuits for g in c.gates} <= set(device.basis_gates)
    assert executable.level == level


@pytest.mark.parametrize("level", [-1, 3, "2"])
def test_an_unknown_level_is_refused(level: object) -> None:
    with pytest.raises(CircuitError, match=r"There is no level .*\n  Levels: 0, 1, 2"):
        pipeline(level, SX)


def test_bind_refuses_other_shapes() -> None:
    executable = compile(program(PAPER))
    for x, theta in [((4, 3), 3), ((4, 2), 2), ((2,), 3)]:
        with pytest.raises(CircuitError, match=r"needs \(B, 2\) and \(3,\)"):
            executable.bind(np.zeros(x), np.zeros(theta))


def test_the_template_has_an_input_for_every_unknown_slot() -> None:
    executable = compile(program(PAPER, "ry(0.4)", "h", "rz(x0) ry(x0) rz(x1)"), level=1)
    template = executable.template()
    assert template.inputs == ("a0_0", "a0_1", "a0_2", "a3_0", "a3_1", "a3_2")
    assert str(template.circuits[0]) == "rz(a0_0) sx rz(a0_1) sx rz(a0_2)"


def test_circuits_fill_the_best_qubits_first() -> None:
    # Readout contrast on fake_lima: 0.9668, 0.96, 0.9478, 0.897, 0.885 for qubits 2, 1, 0, 3, 4.
    qubits, rounds = place(3, load_device("fake_lima"))
    assert sorted(qubits) == [0, 1, 2]
    np.testing.assert_array_equal(rounds, 0)


def test_further_circuits_go_to_the_next_rounds() -> None:
    qubits, rounds = place(24, load_device("fake_lima"))
    assert rounds.max() + 1 == 5
    assert len({*zip(qubits.tolist(), rounds.tolist(), strict=True)}) == 24
    assert np.bincount(rounds).tolist() == [5, 5, 5, 5, 4]
    executable = compile(program(*[PAPER] * 24), load_device("fake_lima"))
    assert executable.round_count == 5


def test_badly_read_qubits_are_left_out() -> None:
    # fake_lagos keeps 0.9666 of <Z> on qubit 3, 0.9416 on qubit 4, less than 0.8 elsewhere.
    qubits, rounds = place(5, load_device("fake_lagos"))
    assert set(qubits.tolist()) == {3, 4}
    assert rounds.max() + 1 == 3


def test_the_ideal_device_has_a_qubit_for_each_circuit() -> None:
    qubits, rounds = place(30, IDEAL)
    np.testing.assert_array_equal(qubits, np.arange(30))
    np.testing.assert_array_equal(rounds, 0)
    assert compile(Program(())).round_count == 0
