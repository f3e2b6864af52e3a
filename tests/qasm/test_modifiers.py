"""inv, pow and ctrl, against Qiskit and against matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from qiskit import qasm3
from qiskit.circuit import library
from qiskit.quantum_info import Operator

from qcompile.errors import ProgramFileError
from qcompile.ir import Circuit
from qcompile.qasm import read

HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
DEFINED = (
    "gate mine a { h a; t a; gphase(0.7); }\ngate phased a { gphase(3); rx(2.8) a; }\n"
    "gate over a { p(1.4*pi) a; }\n"
)
CLASSES = {
    "id": library.IGate, "x": library.XGate, "y": library.YGate, "z": library.ZGate,
    "h": library.HGate, "s": library.SGate, "sdg": library.SdgGate, "t": library.TGate,
    "tdg": library.TdgGate, "sx": library.SXGate, "sxdg": library.SXdgGate,
    "rx": library.RXGate, "ry": library.RYGate, "rz": library.RZGate, "p": library.PhaseGate,
}  # fmt: skip


def matrix(circuit: Circuit) -> np.ndarray:
    result = np.eye(2, dtype=complex)
    for gate in circuit.gates:
        angles = () if gate.angle is None else (gate.angle.constant,)
        result = CLASSES[gate.name](*angles).to_matrix() @ result
    return result


def same(found: np.ndarray, wanted: np.ndarray) -> bool:
    """Equal up to global phase."""
    overlap = np.trace(found.conj().T @ wanted)
    return abs(abs(overlap) - 2) < 1e-10


def read_one(statement: str, head: str = HEAD + DEFINED) -> Circuit:
    (circuit,) = read(f"{head}qubit[1] q;\n{statement}\n").program.circuits
    return circuit


GATES = [
    *("id", "x", "y", "z", "h", "s", "sdg", "t", "tdg", "sx"),
    *(f"{name}({angle})" for name in ("rx", "ry", "rz", "p") for angle in ("0.3", "-2.5", "7.5")),
    *("U(0.3, 1.2, -0.4)", "U(2.5, -3, 1)", "u3(3.1, 0.2, 3)", "u2(0.3, 2.9)", "U(5.2, 4, 1.3)"),
    *("mine", "phased", "over"),
]
POWERS = ["0.5", "-0.5", "1/3.0", "2.7", "-1.25", "3", "-2", "0", "1", "0.5*3", "1e-3"]


@pytest.mark.parametrize("power", POWERS)
@pytest.mark.parametrize("gate", GATES)
def test_powers_are_those_that_qiskit_reads(gate, power):
    statement = f"pow({power}) @ {gate} q[0];"
    # Qiskit's reader has no e in numbers here and no division by 3.0 of a literal: give the value.
    value = eval(power)
    theirs = qasm3.loads(f"{HEAD}{DEFINED}qubit[1] q;\npow({value!r}) @ {gate} q[0];\n")
    assert same(matrix(read_one(statement)), Operator(theirs).data), read_one(statement)


@pytest.mark.parametrize(
    ("statement", "same_as"),
    [
        ("pow(0.5) @ x q;", "sx"),
        ("pow(0.5) @ pow(0.5) @ x q;", "rx(pi/4)"),
        ("pow(0.5) @ z q;", "s"),
        ("pow(0.25) @ inv @ z q;", "t"),  # the inverse of z is z, and its root the principal one
        ("inv @ pow(0.25) @ z q;", "tdg"),
        ("pow(2) @ pow(0.5) @ h q;", "h"),
        ("pow(0.5) @ pow(2) @ h q;", ""),
        ("inv @ pow(0.5) @ inv @ y q;", "ry(-pi/2)"),
        ("pow(0.5) @ rx(pi) q;", "rx(pi/2)"),
        ("pow(1000000000) @ rz(0.1) q;", "rz(100000000)"),
        ("ctrl @ gphase(0.4) q;", "p(0.4)"),
        ("negctrl @ gphase(0.4) q;", "p(-0.4)"),
        ("inv @ ctrl @ gphase(0.4) q;", "p(-0.4)"),
        ("ctrl @ inv @ gphase(0.4) q;", "p(-0.4)"),
        ("ctrl(1) @ pow(3) @ gphase(0.4) q;", "p(1.2)"),
        ("ctrl @ pow(0.5) @ gphase(1.5*pi) q;", "p(-pi/4)"),
        ("pow(0.5) @ ctrl @ gphase(0.4) q;", "p(0.2)"),
        ("gphase(0.4);", ""),
        ("pow(0.5) @ inv @ gphase(0.4);", ""),
        ("mine q;", "h t"),
        ("ctrl @ gphase(2*pi) q;", ""),
    ],
)
def test_modifiers_by_hand(statement, same_as):
    assert same(matrix(read_one(statement)), matrix(Circuit.parse(same_as))), read_one(statement)


def test_the_controlled_phase_is_spread_and_defined():
    text = "gate g(a) b, c { ctrl @ gphase(a) b; ctrl @ gphase(2*a) c; gphase(1); }\nqubit[2] q;\n"
    source = read(f"{HEAD}{text}ctrl @ gphase(0.3) q;\ng(0.1) q[0], q[1];\n")
    assert [str(c) for c in source.program.circuits] == ["p(0.3) p(0.1)", "p(0.3) p(0.2)"]


def test_powers_of_rotations_keep_their_inputs():
    source = read(
        f"{HEAD}input float x;\nqubit q;\npow(0.5) @ rx(x) q;\npow(-1.5) @ p(2*x+1) q;\n"
        "pow(3) @ U(x, 0, 0) q;\nctrl @ gphase(x) q;\n"
    )
    assert source.program.circuits[0] == Circuit.parse(
        "rx(0.5*x) p(-3*x-1.5) " + "rz(0) ry(x) rz(0) " * 3 + "p(x)"
    )


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        (
            "pow(0.5) @ U(x, 0, 0) q[0];",
            "pow(0.5) of a gate that depends on an input is not supported.",
        ),
        ("pow(x) @ rx(1) q[0];", "'x' is not a constant."),
        (
            "pow(0.5) @ both q[0], q[1];",
            "pow(0.5) of this gate on several qubits is not",
        ),
        ("pow(1/2) @ x q[0];", "'1 / 2' divides whole numbers"),
        ("ctrl @ x q[0];", "ctrl @ x q[0] takes at least 2 qubits, found 1."),
        ("ctrl @ ctrl @ gphase(1) q[0];", "takes at least 2 qubits, found 1."),
        ("ctrl(2) @ gphase(1) q[0];", "takes at least 2 qubits, found 1."),
        ("pow(1000000000) @ cx q[0], q[1];", "The program has more than 1000000 gates"),
        ("pow(1000000000) @ ctrl @ x q[0], q[1];", "The program has more than 1000000 gates"),
        ("pow(1000000000) @ x q[0];", "The program has more than 1000000 gates"),
    ],
)
def test_modifiers_that_have_no_meaning_here_are_refused(statement, message):
    text = f"{HEAD}input float x;\ngate both a, b {{ x a; h b; }}\nqubit[2] q;\n{statement}\n"
    with pytest.raises(ProgramFileError) as caught:
        read(text)
    assert message in str(caught.value)


def test_the_root_of_x_is_a_fair_coin():
    z = 1 - 2 * abs(matrix(read_one("pow(0.5) @ x q[0];"))[1, 0]) ** 2
    assert z == pytest.approx(0, abs=1e-12)
    controlled = "h q[0];\nctrl @ gphase(0.4) q[0];\nh q[0];"
    z = 1 - 2 * abs(matrix(read_one(controlled))[1, 0]) ** 2
    assert z == pytest.approx(math.cos(0.4), abs=1e-12)
