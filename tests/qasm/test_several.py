"""Files with gates on several qubits: read as Qiskit reads them, and written for it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm2, qasm3
from qiskit.quantum_info import Operator
from several import difference, program_operator, random_qiskit
from wide import ANY, random_circuit

from qcompile.errors import CircuitError
from qcompile.ir import COUPLINGS, Circuit, Gate, Program
from qcompile.ir.runs import split
from qcompile.qasm import Layout, Mark, Register, read, write

HEAD_3 = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'
VALUES = {"x0": 0.3, "x1": -1.1, "theta0": 0.7, "theta1": 2.0}


@pytest.mark.parametrize("seed", range(100))
def test_what_qiskit_writes_is_read_as_the_same_operator(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(3):
        count = int(rng.integers(1, 6))
        circuit = random_qiskit(rng, count)
        wanted = Operator(circuit).data
        for text in (qasm2.dumps(circuit), qasm3.dumps(circuit)):
            source = read(text)
            found = program_operator(source.program, source.qubits, count)
            assert difference(found, wanted) < 1e-10


def test_qubits_that_gates_connect_are_a_circuit() -> None:
    text = HEAD_3 + (
        "qubit[3] q;\nqubit one;\nqubit[2] r;\nbit[6] c;\nh r;\n"
        "cx q[2], r[0];\nx one;\ncz r[0], q[0];\n"
        "c[0] = measure r[0];\nc[5] = measure one;\nc[2] = measure q[0];\n"
    )
    source = read(text)
    circuits = ["h@2 cx@1,2 cz@2,0", "", "x", "h"]
    assert list(map(str, source.program.circuits)) == circuits
    assert source.qubits == (0, 2, 4, 1, 3, 5)
    places = (("q", 0), ("q", 2), ("r", 0), ("q", 1), ("one", 0), ("r", 1))
    assert source.layout.qubits == places
    assert source.layout.bits == (("c", 2), None, ("c", 0), None, ("c", 5), None)
    again = read(write(source.program, layout=source.layout))
    assert (again.program, again.layout) == (source.program, source.layout)


def test_gates_are_spread_over_registers() -> None:
    text = HEAD_3 + "qubit[3] q;\nqubit[3] r;\nqubit t1;\ncx q, r;\nccx q, r, t1;\nswap t1, r[1];\n"
    source, theirs = read(text), Operator(qasm3.loads(text)).data
    assert difference(program_operator(source.program, source.qubits, 7), theirs) < 1e-10


def test_a_definition_without_couplings_connects_nothing() -> None:
    text = "gate pair(a) b, c { rx(a) b; h c; }\nqubit[2] q;\npair(0.3) q[0], q[1];\n"
    assert list(map(str, read(text).program.circuits)) == ["rx(0.3)", "h"]


def test_marks_count_the_gates_of_their_bits() -> None:
    text = HEAD_3 + (
        "qubit[3] q;\nreset q[2];\nh q[2];\ncx q[2], q[0];\nbarrier q[0], q[1];\nrx(1.0) q[0];\n"
        "delay[10ns] q;\nbit b = measure q[2];\nbarrier q;\n"
    )
    source = read(text)
    assert source.qubits == (0, 2, 1)
    assert source.marks == (
        Mark("reset", (1,), (0,)),
        Mark("barrier", (0, 2), (1, 0)),
        Mark("delay[10ns]", (0, 2, 1), (2, 0, 2)),
        Mark("barrier", (0, 2, 1), (2, 0, None)),
    )
    written = write(source.program, layout=source.layout, marks=source.marks).splitlines()
    assert written[4:] == [
        *("reset q[2];", "h q[2];", "cx q[2], q[0];", "barrier q[0], q[1];", "rx(1.0) q[0];"),
        *("delay[10ns] q[0], q[1], q[2];", "b = measure q[2];", "barrier q[0], q[1], q[2];"),
    ]


def test_marks_that_have_no_order_are_refused() -> None:
    program = Program((Circuit.parse("cx@0,1 h@0 cx@0,1", 2),))
    marks = [Mark("barrier", (0, 1), (0, 1)), Mark("barrier", (0, 1), (3, 0))]
    with pytest.raises(CircuitError, match="have no order: gates put two before each other"):
        write(program, marks=marks)


def random_program(seed: int) -> Program:
    """Two circuits of 1 to 3 qubits, each connected, in the order of files: a gate on one qubit
    comes right before the next coupling of the qubit."""
    rng = np.random.default_rng(seed)
    circuits = []
    for width in rng.integers(1, 4, 2).tolist():
        chain = tuple(Gate("cz", None, (qubit, qubit + 1)) for qubit in range(width - 1))
        circuits.append(Circuit((*random_circuit(rng, ANY, width).gates, *chain), width))
    runs, skeleton = split(Program.of(circuits, 2, 2))
    return skeleton.join(runs)


@pytest.mark.parametrize("seed", range(15))
def test_a_round_trip_is_exact(seed: int) -> None:
    parametric = random_program(seed)
    bound = parametric.substitute(VALUES)
    texts = [(parametric, write(parametric)), (bound, write(bound))]
    for program, text in [*texts, (bound, write(bound, version="2"))]:
        source = read(text)
        assert source.program.circuits == program.circuits
        assert source.layout == Layout.default(program.bits)


@pytest.mark.parametrize("seed", range(15))
def test_qiskit_reads_what_is_written(seed: int) -> None:
    parametric = random_program(seed)
    bound = parametric.substitute(VALUES)
    wanted = program_operator(bound, range(bound.bits), bound.bits)
    for text in (write(bound), write(parametric), write(bound, version="2")):
        circuit = qasm2.loads(text) if text.startswith("OPENQASM 2") else qasm3.loads(text)
        named = {p: VALUES[p.name] for p in circuit.parameters}
        circuit = circuit.assign_parameters(named).remove_final_measurements(inplace=False)
        padded = QuantumCircuit(bound.bits).compose(circuit, range(circuit.num_qubits))
        assert difference(Operator(padded).data, wanted) < 1e-10


def test_golden_texts() -> None:
    gates = "h@0 ecr@0,1 sx@1 cz@1,0 rz(x0)@1 cx@1,2"
    program = Program((Circuit.parse(gates, 3), Circuit.parse("x")), ("x0",))
    assert write(program, qubits=[4, 3, 5, 0]).splitlines() == [
        *("OPENQASM 3.0;", 'include "stdgates.inc";'),
        *("gate ecr a, b { s a; sx b; cx a, b; x a; }", "input float[64] x0;", "bit[4] c;"),
        *("h $4;", "ecr $4, $3;", "sx $3;", "cz $3, $4;", "rz(x0) $3;", "cx $3, $5;", "x $0;"),
        *("c[0] = measure $4;", "c[1] = measure $3;", "c[2] = measure $5;", "c[3] = measure $0;"),
    ]
    assert write(program.substitute({"x0": 0.5}), version="2").splitlines() == [
        *("OPENQASM 2.0;", 'include "qelib1.inc";', "gate sx a { sdg a; h a; sdg a; }"),
        "gate ecr a, b { s a; sdg b; h b; sdg b; cx a, b; x a; }",
        *("qreg q[4];", "creg c[4];", "h q[0];", "ecr q[0], q[1];", "sx q[1];", "cz q[1], q[0];"),
        *("rz(0.5) q[1];", "cx q[1], q[2];", "x q[3];"),
        *(f"measure q[{i}] -> c[{i}];" for i in range(4)),
    ]


@pytest.mark.parametrize("version", ["3", "2"])
@pytest.mark.parametrize("name", COUPLINGS)
def test_couplings_read_back_as_themselves(name: str, version: str) -> None:
    program = Program((Circuit((Gate(name, None, (1, 0)),), 2),))
    assert read(write(program, version=version)).program == program  # type: ignore[arg-type]


def test_names_of_defined_couplings_are_not_free() -> None:
    layout = Layout((Register("ecr", 2),), (), (("ecr", 0), ("ecr", 1)), (None, None))
    with pytest.raises(CircuitError, match="'ecr' is not a valid name"):
        write(Program((Circuit.parse("ecr@0,1", 2),)), layout=layout)
    assert "qubit[2] ecr;" in write(Program.of([Circuit()] * 2), layout=layout)


def test_a_layout_of_another_size_is_refused() -> None:
    with pytest.raises(CircuitError, match="The layout has 1 qubits, the program 2 qubits"):
        write(Program((Circuit.parse("cx@0,1", 2),)), layout=Layout.default(1))


def test_a_qubit_is_measured_into_every_bit_that_the_file_says() -> None:
    text = HEAD_2 + (
        "qreg q[2];\ncreg a[2];\ncreg b[2];\nh q[0];\ncx q[0],q[1];\nmeasure q -> a;\n"
        "measure q[1] -> b[0];\n"
    )
    source = read(text)
    written = write(source.program, layout=source.layout, version="2").splitlines()
    assert written[-3:] == [
        *("measure q[0] -> a[0];", "measure q[1] -> a[1];", "measure q[1] -> b[0];"),
    ]


def test_127_qubits_are_read_in_seconds() -> None:
    lines = [HEAD_2 + "qreg q[127];\ncreg c[127];"]
    for layer in range(50):
        lines += [f"ry({layer}.{i}) q[{i}];" for i in range(127)]
        lines += [f"cx q[{i}],q[{i + 1}];" for i in range(126)]
    start = time.perf_counter()
    (circuit,) = read("\n".join([*lines, "measure q -> c;"])).program.circuits
    assert (circuit.width, len(circuit)) == (127, 50 * 253)
    assert time.perf_counter() - start < 5
