"""Reading OpenQASM: the same unitaries as Qiskit's parsers, and reading files."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from qcompile.errors import ProgramFileError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.qasm import Layout, Register, Source, read, read_file
from qcompile.simulate import Simulator

qiskit_qasm2 = pytest.importorskip("qiskit.qasm2")
qiskit_qasm3 = pytest.importorskip("qiskit.qasm3")

HEAD_3 = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'


def expectations(source: Source) -> np.ndarray:
    return Simulator(source.program).expectation(np.zeros((1, 0)), np.zeros(0))[0]


def qiskit_expectations(circuit) -> np.ndarray:
    from qiskit.quantum_info import Pauli, Statevector

    circuit.remove_final_measurements()
    state = Statevector(circuit)
    return np.array(
        [state.expectation_value(Pauli("Z"), [i]).real for i in range(state.num_qubits)]
    )


def circuits(*texts: str) -> tuple[Circuit, ...]:
    return tuple(map(Circuit.parse, texts))


# A probe rotation before and after makes <Z> depend on the axis and the sense of each gate.
def probed(gate: str) -> str:
    return f"ry(0.7) q[0];\nrz(0.4) q[0];\n{gate}\nrz(1.1) q[0];\nry(0.3) q[0];\n"


GATES = [
    *(f"{name} q[0];" for name in FIXED_GATES),
    *(f"{name}(0.6) q[0];" for name in ROTATION_GATES),
    "u1(0.6) q[0];",
    "u2(0.6, -1.3) q[0];",
    "u3(0.6, -1.3, 2.2) q[0];",
    "U(0.6, -1.3, 2.2) q[0];",
    "rx(-3*pi/4) q[0];",
    "rx(-(pi+1)/3) q[0];",
]


@pytest.mark.parametrize("gate", GATES)
def test_openqasm_2_gates_agree_with_qiskit(gate):
    text = HEAD_2 + "qreg q[1];\n" + probed(gate)
    legacy = qiskit_qasm2.LEGACY_CUSTOM_INSTRUCTIONS
    theirs = qiskit_expectations(qiskit_qasm2.loads(text, custom_instructions=legacy))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


@pytest.mark.parametrize("expression", ["sin(pi/8)^2", "2*pi^2", "-pi^2", "ln(3)+sqrt(2)*1/2"])
def test_openqasm_2_expressions_agree_with_qiskit(expression):
    test_openqasm_2_gates_agree_with_qiskit(f"rx({expression}) q[0];")


@pytest.mark.parametrize(
    "gate",
    [
        *(g for g in GATES if not g.startswith("sxdg")),
        "phase(0.6) q[0];",
        "inv @ sx q[0];",
        "inv @ u3(0.6, -1.3, 2.2) q[0];",
        "pow(3) @ t q[0];",
        "pow(-2) @ inv @ rx(0.4) q[0];",
        "inv @ pow(2) @ s q[0];",
        "gphase(0.3);",
    ],
)
def test_openqasm_3_gates_agree_with_qiskit(gate):
    text = HEAD_3 + "qubit[1] q;\n" + probed(gate)
    theirs = qiskit_expectations(qiskit_qasm3.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


def test_defined_gates_and_broadcasts_agree_with_qiskit():
    text = HEAD_3 + (
        "gate turn(a, b) c { rz(a+b/2) c; sx c; }\n"
        "gate pair(a) c, d { turn(a, 0.5) c; h d; barrier c, d; inv @ turn(2*a, a) d; }\n"
        "qubit[2] q;\nqubit[2] r;\nqubit t1;\n"
        "h q;\npair(0.3) q, r;\npair(0.7) t1, q[1];\nbarrier q, r[0];\npow(2) @ pair(0.1) r, q;\n"
        "ry(0.4) q;\nrx(1.0) r;\nry(0.2) t1;\n"
    )
    theirs = qiskit_expectations(qiskit_qasm3.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


def test_r_turns_about_an_axis_in_the_plane():
    from qiskit import QuantumCircuit

    text = HEAD_2 + "qreg q[1];\n" + probed("r(0.6,-1.3) q[0];")
    theirs = QuantumCircuit(1)
    theirs.ry(0.7, 0)
    theirs.rz(0.4, 0)
    theirs.r(0.6, -1.3, 0)
    theirs.rz(1.1, 0)
    theirs.ry(0.3, 0)
    np.testing.assert_allclose(expectations(read(text)), qiskit_expectations(theirs), atol=1e-9)


def test_a_file_of_qiskit_is_read():
    from qiskit import QuantumCircuit

    rng = random.Random(5)
    circuit = QuantumCircuit(4)
    for _ in range(40):
        name = rng.choice(["h", "sx", "sxdg", "t", "rx", "ry", "p", "x"])
        qubit = rng.randrange(4)
        angle = [rng.uniform(-4, 4)] if name in ROTATION_GATES else []
        getattr(circuit, name)(*angle, qubit)
    expected = qiskit_expectations(circuit.copy())
    circuit.measure_all()
    for text in (qiskit_qasm2.dumps(circuit), qiskit_qasm3.dumps(circuit)):
        source = read(text)
        np.testing.assert_allclose(expectations(source), expected, atol=1e-9)
        assert source.layout.bits == tuple(("meas", i) for i in range(4))


def test_inputs_constants_and_expressions_are_affine():
    source = read(
        "OPENQASM 3.0;\ninput float[64] x;\ninput angle theta;\nconst float k = 2*cos(0);\n"
        "const int n = 4;\nqubit q;\n"
        "rx(k*x - theta/n + n/2) q;\nrz(-(x + 1.5e0) * 2 + tau - 2*pi + 2**3 + euler - euler) q;\n"
    )
    assert source.program == Program(circuits("rx(2*x-0.25*theta+2) rz(-2*x+5)"), ("x", "theta"))


def test_registers_bits_and_physical_qubits_are_kept():
    source = read(
        "qubit a;\nqubit[2] b;\nbit[3] c;\nbit d = measure a;\nx $7;\nc[2] = measure b[0];\n"
        "c[0:0] = measure b[1:1];\nmeasure $7;\n"
    )
    assert source == Source(
        Program(circuits("", "", "", "x")),
        Layout(
            (Register("a", None), Register("b", 2)),
            (Register("c", 3), Register("d", None)),
            (("a", 0), ("b", 0), ("b", 1), 7),
            (("d", 0), ("c", 2), ("c", 0), None),
        ),
    )


def test_slices_aliases_and_negative_indices_name_qubits():
    source = read(
        "qubit[5] q;\nlet even = q[0:2:4];\nlet both = even[{0, 2}] ++ q[1:1];\n"
        "x even;\ny both[-1];\nz q[-1];\nh q[3:-1:2];\n"
    )
    assert source.program.circuits == circuits("x", "y", "x h", "h", "x z")


def test_broadcast_measurement_of_openqasm_2():
    source = read(HEAD_2 + "qreg q[2];\ncreg c[2];\nreset q;\nx q;\nbarrier q;\nmeasure q -> c;\n")
    assert source.program.circuits == circuits("x", "x")
    assert source.layout == Layout.default(2)


def test_a_gate_the_file_defines_hides_the_table():
    source = read(HEAD_2 + "gate sx a { h a; }\nqreg q[1];\nsx q[0];\n")
    assert source.program.circuits == circuits("h")


def test_files(tmp_path):
    path = tmp_path / "good.qasm"
    path.write_text("\N{ZERO WIDTH NO-BREAK SPACE}qubit q;\nx q;\n", encoding="utf-8")
    assert read_file(path).program.circuits == circuits("x")
    with pytest.raises(ProgramFileError) as caught:
        read_file(tmp_path / "missing.qasm")
    assert str(caught.value) == (
        f"{tmp_path}/missing.qasm: The file cannot be read: No such file or directory.\n"
        "  Give the path of an OpenQASM 2 or 3 program."
    )
    path.write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(ProgramFileError, match=r"good\.qasm: It is UTF-16 text"):
        read_file(str(path))
    path.write_text("qubit q;\nnope q;\n")
    with pytest.raises(ProgramFileError, match=r"good\.qasm:2: Unknown gate 'nope'"):
        read_file(path)


def test_an_angle_reads_back_exactly():
    rng = random.Random(3)
    values = [rng.uniform(-7, 7) for _ in range(50)] + [k * math.pi / 16 for k in range(-40, 40)]
    text = "".join(f"rz({value!r}) $0;\n" for value in values)
    read_back = [gate.angle.constant for gate in read(text).program.circuits[0].gates]
    assert read_back == values
