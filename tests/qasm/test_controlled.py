"""Controlled gates are the operators that control says, phases included, by Qiskit's matrices."""

from __future__ import annotations

import random

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm3
from qiskit.circuit import library
from qiskit.quantum_info import Operator
from several import difference, program_operator
from wide import ANY, operator, random_circuit

from qcompile.ir import COUPLINGS, FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate
from qcompile.qasm import read
from qcompile.qasm.controlled import controlled
from qcompile.qasm.gates import KNOWN_GATES, standard
from qcompile.qasm.modifiers import Unitary

GATES = [
    *(Circuit((Gate(name),)) for name in FIXED_GATES),
    *(Circuit((Gate(name, Angle(0.7)),)) for name in ROTATION_GATES),
    *(Circuit((Gate(name, None, pair),), 2) for name in COUPLINGS for pair in ((0, 1), (1, 0))),
]
SYMBOLS = {"x0": 0.3, "x1": -1.1, "theta0": 0.7, "theta1": 2.0}


def under_control(matrix: np.ndarray, controls: int) -> np.ndarray:
    """The matrix where the first qubits, the lowest of Qiskit's, are all 1."""
    size, ones = matrix.shape[0] << controls, (1 << controls) - 1
    whole = np.eye(size, dtype=complex)
    rows = [row for row in range(size) if row & ones == ones]
    whole[np.ix_(rows, rows)] = matrix
    return whole


@pytest.mark.parametrize("controls", [1, 2, 3])
@pytest.mark.parametrize("circuit", GATES, ids=str)
def test_every_gate_under_controls(circuit: Circuit, controls: int) -> None:
    for phase in (0.0, 1.3):
        gates = tuple(controlled(circuit.gates, Angle(phase), controls))
        found = operator(Circuit(gates, controls + circuit.width), {})
        wanted = under_control(operator(circuit, {}) * np.exp(1j * phase), controls)
        np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_random_sequences_under_controls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = random_circuit(rng, ANY, int(rng.integers(1, 4))).substitute(SYMBOLS)
    around = tuple(Unitary(circuit.gates[:2]).inverse().gates)
    circuit = Circuit((*circuit.gates, *around), circuit.width)
    gates = tuple(controlled(circuit.gates, Angle(0.4), 2))
    found = operator(Circuit(gates, 2 + circuit.width), {})
    wanted = under_control(operator(circuit, {}) * np.exp(0.4j), 2)
    np.testing.assert_allclose(found, wanted, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "couplings"),
    [
        *(("cy", 1), ("ch", 1), ("crx", 2), ("crz", 2), ("cp", 2), ("csx", 2), ("cu3", 2)),
        *(("ccx", 6), ("ccz", 6), ("cswap", 8), ("c3x", 14), ("c4x", 30), ("swap", 3)),
        *(("rzz", 2), ("rxx", 2), ("rzx", 2), ("iswap", 2), ("xx_plus_yy", 2), ("ecr", 1)),
    ],
)
def test_how_many_couplings_a_gate_has(name: str, couplings: int) -> None:
    gate = next(g for count in range(4) if (g := made(name, count)) is not None)
    assert sum(part.is_coupling for part in gate.gates) == couplings


def made(name: str, angles: int) -> Unitary | None:
    try:
        return standard(name, [Angle(0.1 * (k + 1)) for k in range(angles)])
    except Exception:
        return None


TABLE = {
    "cx": library.CXGate, "CX": library.CXGate, "cnot": library.CXGate, "cz": library.CZGate,
    "cy": library.CYGate, "ch": library.CHGate, "cs": library.CSGate, "csdg": library.CSdgGate,
    "csx": library.CSXGate, "cv": library.CSXGate, "crx": library.CRXGate, "cry": library.CRYGate,
    "crz": library.CRZGate, "cp": library.CPhaseGate, "cphase": library.CPhaseGate,
    "cphaseshift": library.CPhaseGate, "cu1": library.CU1Gate, "cu3": library.CU3Gate,
    "cu": library.CUGate, "ccx": library.CCXGate, "ccnot": library.CCXGate,
    "ccz": library.CCZGate, "c3x": library.C3XGate, "c3sqrtx": library.C3SXGate,
    "c4x": library.C4XGate, "swap": library.SwapGate, "cswap": library.CSwapGate,
    "iswap": library.iSwapGate, "dcx": library.DCXGate, "ecr": library.ECRGate,
    "rxx": library.RXXGate, "xx": library.RXXGate, "ryy": library.RYYGate, "yy": library.RYYGate,
    "rzz": library.RZZGate, "zz": library.RZZGate, "RZZ": library.RZZGate,
    "rzx": library.RZXGate, "xx_plus_yy": library.XXPlusYYGate,
    "xx_minus_yy": library.XXMinusYYGate, "rccx": library.RCCXGate, "rc3x": library.RC3XGate,
    "rcccx": library.RC3XGate,
}  # fmt: skip
"""Gates on several qubits by name, and Qiskit's classes of the same matrix."""


def exchanged(a: float) -> np.ndarray:
    """Braket's PSwap and, with a = 0, swap: |01> and |10> exchanged, with a phase."""
    phase = np.exp(1j * a)
    return np.array([[1, 0, 0, 0], [0, 0, phase, 0], [0, phase, 0, 0], [0, 0, 0, 1]])


def xy(a: float) -> np.ndarray:
    cos, sin = np.cos(a / 2), 1j * np.sin(a / 2)
    return np.array([[1, 0, 0, 0], [0, cos, sin, 0], [0, sin, cos, 0], [0, 0, 0, 1]])


def ms(first: float, second: float, theta: float) -> np.ndarray:
    """Braket's MS, the first qubit the most significant."""
    cos, sin = np.cos(theta / 2), -1j * np.sin(theta / 2)
    total, gap = np.exp(1j * (first + second)), np.exp(1j * (first - second))
    return np.array(
        [
            [cos, 0, 0, sin / total],
            [0, cos, sin / gap, 0],
            [0, sin * gap, cos, 0],
            [sin * total, 0, 0, cos],
        ]
    )


def phase_at(place: int) -> object:
    return lambda a: np.diag([np.exp(1j * a) if i == place else 1 for i in range(4)])


def turned(a: float, b: float, c: float) -> np.ndarray:
    pauli = {"X": np.array([[0, 1], [1, 0]]), "Y": np.array([[0, -1j], [1j, 0]])}
    pauli["Z"] = np.diag([1, -1])
    total = sum(
        angle / 2 * np.kron(pauli[axis], pauli[axis])
        for axis, angle in zip("XYZ", (a, b, c), strict=True)
    )
    values, vectors = np.linalg.eigh(total)
    return vectors @ np.diag(np.exp(-1j * values)) @ vectors.conj().T


BY_HAND = {
    "pswap": exchanged, "xy": xy, "ms": ms, "Rxxyyzz": turned,
    "ZZ": lambda: turned(0, 0, np.pi / 2), "iswapdg": lambda: xy(-np.pi),
    "csxdg": lambda: under_control_first(library.SXdgGate().to_matrix()),
    "cphaseshift00": phase_at(0), "cphaseshift01": phase_at(1), "cphaseshift10": phase_at(2),
}  # fmt: skip
"""Published matrices on two qubits, the first the most significant."""


def under_control_first(matrix: np.ndarray) -> np.ndarray:
    return np.kron(np.diag([1, 0]), np.eye(2)) + np.kron(np.diag([0, 1]), matrix)


@pytest.mark.parametrize("name", [*TABLE, *BY_HAND])
def test_gates_of_the_table_are_the_published_matrices_phase_included(name: str) -> None:
    for count in range(5):
        gate = made(name, count)
        if gate is None:
            continue
        angles = [0.1 * (k + 1) for k in range(count)]
        built = QuantumCircuit(gate.width, global_phase=gate.phase.constant)
        if name in TABLE:
            wanted = TABLE[name](*angles).to_matrix()
        else:
            wanted = Operator(BY_HAND[name](*angles)).reverse_qargs().data  # type: ignore[operator]
        for part in gate.gates:
            values = () if part.angle is None else (part.angle.constant,)
            getattr(built, part.name)(*values, *part.qubits)
        np.testing.assert_allclose(Operator(built).data, wanted, atol=1e-12)
        return
    pytest.fail(f"no {name}")


def test_the_tables_here_have_every_gate_on_several_qubits() -> None:
    several = {
        name for name in KNOWN_GATES for n in range(5) if (g := made(name, n)) and g.width > 1
    }
    assert several == {*TABLE, *BY_HAND}


HEAD = """OPENQASM 3.0;
include "stdgates.inc";
gate mine a { h a; t a; gphase(0.7); }
gate two(t) a, b { h a; ctrl @ rx(t) a, b; gphase(t/3); rz(-t) b; }
gate three a, b, c { two(0.3) a, b; negctrl @ ctrl @ y a, b, c; inv @ two(1.1) c, a; }
gate only(a) q { gphase(a); }
qubit[4] q;
"""
NAMES = {
    1: "x y h s tdg sx id mine rx(0.3) ry(-2.1) rz(1.7) p(0.9) U(0.3,1.2,-0.4) u2(0.3,2.9) only(1)",
    2: "cx cz cy ch swap cp(0.7) crx(0.5) crz(2.2) two(0.6) CX",
    3: "ccx cswap three",
}


def statement(rng: random.Random) -> str:
    width = rng.choice([1, 1, 2, 2, 3])
    name, modifiers = rng.choice(NAMES[width].split()), ""
    for _ in range(rng.choice([1, 1, 2, 3])):
        modifier, controls = rng.choice(
            [("inv", 0), ("pow(2)", 0), ("pow(-1)", 0), ("ctrl", 1), ("negctrl", 1), ("ctrl(2)", 2)]
        )
        if width + controls <= 4:
            width += controls
            modifiers = f"{modifier} @ {modifiers}"
    return f"{modifiers}{name} {', '.join(f'q[{i}]' for i in rng.sample(range(4), width))};\n"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("seed", range(60))
def test_modified_gates_are_those_that_qiskit_reads(seed: int) -> None:
    rng = random.Random(seed)
    text = HEAD + statement(rng) + statement(rng)
    source, theirs = read(text), Operator(qasm3.loads(text)).data
    assert difference(program_operator(source.program, source.qubits, 4), theirs) < 1e-10


@pytest.mark.parametrize(
    ("statement", "same_as"),
    [
        ("pow(0.5) @ cx q[0], q[1];", "csx q[0], q[1];"),
        ("pow(0.5) @ pow(0.5) @ ctrl @ z q[0], q[1];", "ctrl @ t q[0], q[1];"),
        ("pow(0.25) @ crx(x) q[0], q[1];", "crx(x/4) q[0], q[1];"),
        ("pow(3) @ ctrl @ p(x) q[0], q[1];", "cp(3*x) q[0], q[1];"),
        ("pow(-0.5) @ rzz(x) q[0], q[1];", "rzz(-x/2) q[0], q[1];"),
        ("pow(2.5) @ rxx(x) q[0], q[1];", "rxx(2.5*x) q[0], q[1];"),
        ("pow(0.5) @ swap q[0], q[1];", "cx q[0], q[1]; csx q[1], q[0]; cx q[0], q[1];"),
        ("pow(1/3.0) @ negctrl @ ry(x) q[0], q[1];", "negctrl @ ry(x/3) q[0], q[1];"),
        ("inv @ pow(0.5) @ cswap q[0], q[1], q[2];", "pow(-0.5) @ cswap q[0], q[1], q[2];"),
        ("ctrl(2) @ gphase(x) q[0], q[1];", "cp(x) q[0], q[1];"),
        ("negctrl(2) @ gphase(x) q[0], q[1];", "x q; cp(x) q[0], q[1]; x q;"),
        ("ctrl @ only(x) q[0], q[1];", "p(x) q[0];"),
    ],
)
def test_modifiers_by_hand(statement: str, same_as: str) -> None:
    head = HEAD.replace("qubit[4] q", "input float x;\nqubit[3] q")
    operators = []
    for text in (statement, same_as):
        source = read(f"{head}{text}\n")
        program = source.program.substitute({"x": 0.83})
        operators.append(program_operator(program, source.qubits, 3))
    assert difference(*operators) < 1e-12


def test_controls_of_controls_cost_no_more_than_as_many_at_once() -> None:
    head = HEAD.replace("qubit[4]", "qubit[5]")
    statements = (
        "ctrl(4) @ x {};", "ctrl @ ctrl @ ctrl @ ctrl @ x {};", "ctrl(2) @ ccx {};", "c4x {};",
        "ctrl @ inv @ ctrl @ ctrl @ cx {};",
    )  # fmt: skip
    qubits = ", ".join(f"q[{i}]" for i in range(5))
    programs = {read(head + s.format(qubits) + "\n").program.circuits for s in statements}
    assert len(programs) == 1


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_controls_of_a_definition_are_those_of_its_phase_too() -> None:
    """Qiskit keeps the phase of a definition: without it, the control would be another one."""
    text = HEAD + "ctrl @ mine q[0], q[1];\n"
    source = read(text)
    found = program_operator(source.program, source.qubits, 4)
    assert difference(found, Operator(qasm3.loads(text)).data) < 1e-12
    without = read(text.replace(" gphase(0.7);", ""))
    other = program_operator(without.program, without.qubits, 4)
    assert difference(found, other) > 0.1
