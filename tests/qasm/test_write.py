"""Writing OpenQASM: golden texts, round trips, and parsing by other tools."""

from __future__ import annotations

import random
import subprocess
import sys

import numpy as np
import pytest

from qcompile.device import IDEAL
from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate, LateAngle, Program
from qcompile.native import RX, SX
from qcompile.passes import compile as compile_program
from qcompile.passes import lower
from qcompile.qasm import Layout, Register, read, write
from qcompile.simulate import Simulator

NO_INPUTS = np.zeros((1, 0)), np.zeros(0)


def circuits(*texts: str) -> tuple[Circuit, ...]:
    return tuple(map(Circuit.parse, texts))


def random_program(seed: int, inputs: int = 0) -> Program:
    rng = random.Random(seed)
    symbols = [f"x{i}" for i in range(inputs)]

    def angle() -> Angle:
        value = Angle(rng.choice([rng.uniform(-7, 7), rng.randint(-8, 8) * np.pi / 4, 1e-7]))
        for symbol in rng.sample(symbols, rng.randint(0, inputs)):
            value = value + Angle.symbol(symbol) * rng.choice([1, -1, 0.5, rng.uniform(-2, 2)])
        return value

    def gate() -> Gate:
        name = rng.choice([*FIXED_GATES, *ROTATION_GATES])
        return Gate(name, angle() if name in ROTATION_GATES else None)

    made = [Circuit(tuple(gate() for _ in range(rng.randint(0, 8)))) for _ in range(4)]
    return Program(tuple(made), tuple(symbols))


def expectations(program: Program) -> np.ndarray:
    return Simulator(program).expectation(*NO_INPUTS)[0]


def qiskit_expectations(circuit) -> np.ndarray:
    from qiskit.quantum_info import Pauli, Statevector

    measured = {
        circuit.find_bit(i.clbits[0]).index: circuit.find_bit(i.qubits[0]).index
        for i in circuit.data
        if i.operation.name == "measure"
    }
    gates = circuit.copy()
    gates.data = [i for i in circuit.data if i.operation.name != "measure"]
    state = Statevector(gates)
    return np.array(
        [state.expectation_value(Pauli("Z"), [measured[bit]]).real for bit in sorted(measured)]
    )


def amplitude_expectations(state: np.ndarray) -> np.ndarray:
    """<Z> of each qubit of a state whose first qubit is the most significant."""
    qubits = int(np.log2(len(state)))
    weights = (np.abs(state) ** 2).reshape((2,) * qubits)
    marginals = [np.moveaxis(weights, i, 0).reshape(2, -1).sum(axis=1) for i in range(qubits)]
    return np.array([m[0] - m[1] for m in marginals])


def cirq_expectations(circuit, qubits: int) -> np.ndarray:
    import cirq

    order = [cirq.NamedQubit(f"q_{i}") for i in range(qubits)]
    gates = cirq.Circuit(op for op in circuit.all_operations() if not cirq.is_measurement(op))
    return amplitude_expectations(gates.final_state_vector(qubit_order=order, dtype=complex))


COMPILED = [
    pytest.param(seed, level, native, id=f"seed {seed} level {level} {native}")
    for seed in range(3)
    for level in (0, 1, 2)
    for native in (SX, RX)
]


@pytest.mark.parametrize(("seed", "level", "native"), COMPILED)
def test_qiskit_reads_the_output(seed, level, native):
    qasm2, qasm3 = pytest.importorskip("qiskit.qasm2"), pytest.importorskip("qiskit.qasm3")
    source = random_program(seed)
    program, expected = lower(source, level, native), expectations(source)
    for circuit in (
        qasm2.loads(write(program, version="2")),
        qasm2.loads(
            write(program, version="2"), custom_instructions=qasm2.LEGACY_CUSTOM_INSTRUCTIONS
        ),
        qasm3.loads(write(program)),
        qasm3.loads(write(program, qubits=[2, 0, 3, 1])),
    ):
        np.testing.assert_allclose(qiskit_expectations(circuit), expected, atol=1e-9)


@pytest.mark.parametrize(("seed", "level", "native"), COMPILED)
def test_pytket_reads_the_output(seed, level, native):
    pytket, pytket_qasm = pytest.importorskip("pytket"), pytest.importorskip("pytket.qasm")
    source = random_program(seed)
    program = lower(source, level, native)
    circuit = pytket_qasm.circuit_from_qasm_str(write(program, version="2"))
    gates = pytket.Circuit(len(program))
    for command in circuit.get_commands():
        if command.op.type != pytket.OpType.Measure:
            gates.add_gate(command.op, [qubit.index[0] for qubit in command.qubits])
    found = amplitude_expectations(gates.get_statevector())
    np.testing.assert_allclose(found, expectations(source), atol=1e-9)


@pytest.mark.parametrize(("seed", "level", "native"), COMPILED)
def test_cirq_reads_the_output(seed, level, native):
    qasm_import = pytest.importorskip("cirq.contrib.qasm_import")
    source = random_program(seed)
    program, expected = lower(source, level, native), expectations(source)
    for version in ("2", "3"):
        circuit = qasm_import.circuit_from_qasm(write(program, version=version))
        found = cirq_expectations(circuit, len(program))
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_every_gate_of_the_table_is_read_by_strict_readers():
    qasm2, qasm3 = pytest.importorskip("qiskit.qasm2"), pytest.importorskip("qiskit.qasm3")
    gates = [*FIXED_GATES, *(f"{name}(0.6)" for name in ROTATION_GATES)]
    program = Program(circuits(*(f"ry(0.7) rz(0.4) {g} rz(1.1) ry(0.3)" for g in gates[:8])))
    rest = Program(circuits(*(f"ry(0.7) rz(0.4) {g} rz(1.1) ry(0.3)" for g in gates[8:])))
    for part in (program, rest):
        for circuit in (qasm2.loads(write(part, version="2")), qasm3.loads(write(part))):
            np.testing.assert_allclose(qiskit_expectations(circuit), expectations(part), atol=1e-9)


def test_qiskit_binds_the_inputs_of_a_parametric_program():
    qasm3 = pytest.importorskip("qiskit.qasm3")
    program = random_program(7, inputs=3)
    values = {"x0": 0.3, "x1": -1.7, "x2": 2.9}
    for text in (write(program), write(program, qubits=range(4))):
        circuit = qasm3.loads(text)
        used = {parameter.name for parameter in circuit.parameters}
        bound = circuit.assign_parameters({n: v for n, v in values.items() if n in used})
        expected = expectations(program.substitute(values))
        np.testing.assert_allclose(qiskit_expectations(bound), expected, atol=1e-9)


def test_the_template_of_an_executable_binds_in_qiskit():
    qasm3 = pytest.importorskip("qiskit.qasm3")
    program = random_program(8, inputs=2)
    executable = compile_program(program, IDEAL)
    template, x = executable.template(), np.array([[0.4, -2.2]])
    angles = executable.bind(x, np.zeros(0))[0]
    values = {name: angles[int(name[1:].split("_")[0])] for name in template.inputs}
    circuit = qasm3.loads(write(template)).assign_parameters(values)
    expected = Simulator(program).expectation(x, np.zeros(0))[0]
    np.testing.assert_allclose(qiskit_expectations(circuit), expected, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_a_round_trip_is_exact(seed):
    parametric, bound = random_program(seed, inputs=3), random_program(seed)
    for program, text in (
        (parametric, write(parametric)),
        (bound, write(bound)),
        (bound, write(bound, version="2")),
    ):
        source = read(text)
        assert (source.program, source.layout) == (program, Layout.default(4))


@pytest.mark.parametrize("seed", range(5))
def test_physical_qubits_read_back_with_their_circuits_and_bits(seed):
    """In another order: a file without declarations shows a qubit when it is first used."""
    program, qubits = random_program(seed, inputs=3), [4, 0, 2, 7]
    source = read(write(program, qubits=qubits))
    order = [qubits.index(qubit) for qubit in source.layout.qubits]
    assert source.program.inputs == program.inputs
    assert source.program.circuits == tuple(program.circuits[i] for i in order)
    assert source.layout.bits == tuple(("c", i) for i in order)


SMALL = Program(circuits("h rz(0.5*x0+theta0-pi/2) sx", "", "sxdg p(1e-07)"), ("x0",), ("theta0",))

GOLDEN_3 = """\
OPENQASM 3.0;
include "stdgates.inc";
gate sxdg a { s a; h a; s a; }
input float[64] x0;
input float[64] theta0;
qubit[3] q;
bit[3] c;
h q[0];
rz(theta0+0.5*x0-pi/2) q[0];
sx q[0];
sxdg q[2];
p(1e-07) q[2];
c[0] = measure q[0];
c[1] = measure q[1];
c[2] = measure q[2];
"""

GOLDEN_3_PHYSICAL = """\
OPENQASM 3.0;
include "stdgates.inc";
gate sxdg a { s a; h a; s a; }
input float[64] x0;
input float[64] theta0;
bit[3] c;
h $5;
rz(theta0+0.5*x0-pi/2) $5;
sx $5;
sxdg $3;
p(1e-07) $3;
c[0] = measure $5;
c[1] = measure $0;
c[2] = measure $3;
"""

GOLDEN_2 = """\
OPENQASM 2.0;
include "qelib1.inc";
gate sx a { sdg a; h a; sdg a; }
gate sxdg a { s a; h a; s a; }
gate p(a) b { u1(a) b; }
qreg q[3];
creg c[3];
h q[0];
rz(pi/2) q[0];
sx q[0];
sxdg q[2];
p(1.0e-07) q[2];
measure q[0] -> c[0];
measure q[1] -> c[1];
measure q[2] -> c[2];
"""


def test_golden_texts():
    assert write(SMALL) == GOLDEN_3
    assert write(SMALL, qubits=[5, 0, 3]) == GOLDEN_3_PHYSICAL
    bound = SMALL.substitute({"x0": 0.0, "theta0": np.pi})
    assert write(bound, version="2") == GOLDEN_2


NAMED = Layout(
    (Register("a", None), Register("b", 2)),
    (Register("out", 2), Register("flag", None), Register("spare", 1)),
    (("a", 0), ("b", 0), ("b", 1)),
    (("out", 1), ("flag", 0), None),
)


def test_a_layout_names_registers_and_bits():
    program = Program(circuits("x", "h", "z"))
    text = write(program, layout=NAMED)
    assert text.splitlines()[2:] == [
        "qubit a;",
        "qubit[2] b;",
        "bit[2] out;",
        "bit flag;",
        "bit[1] spare;",
        "x a;",
        "h b[0];",
        "z b[1];",
        "out[1] = measure a;",
        "flag = measure b[0];",
    ]
    source = read(text)
    assert (source.program, source.layout) == (program, NAMED)
    assert write(program, layout=NAMED, version="2").splitlines()[2:] == [
        "qreg a[1];",
        "qreg b[2];",
        "creg out[2];",
        "creg flag[1];",
        "creg spare[1];",
        "x a[0];",
        "h b[0];",
        "z b[1];",
        "measure a[0] -> out[1];",
        "measure b[0] -> flag[0];",
    ]


ONE = Program(circuits("rz(x0)"), ("x0",))
FUSED = Program(circuits("rz(b0)"), late_angles=(LateAngle("b0", Circuit.parse("h"), "polar"),))


@pytest.mark.parametrize(
    ("program", "options", "message"),
    [
        (
            ONE,
            {"version": "2"},
            "OpenQASM 2 has no inputs; the program has x0.\n"
            "  Bind them to numbers first, or write OpenQASM 3.",
        ),
        (
            FUSED,
            {},
            "A program with late angles cannot be written as OpenQASM.\n"
            "  Write executable.template(), or bind the angles first.",
        ),
        (
            Program(circuits("x")),
            {"version": "2", "qubits": [3]},
            "OpenQASM 2 cannot name physical qubits.\n  Write OpenQASM 3, or leave out `qubits`.",
        ),
        (ONE, {"version": "4"}, "Unknown OpenQASM version '4'.\n  Use 3 or 2."),
        (
            ONE,
            {"layout": Layout.default(2)},
            "The layout has 2 qubits, the program 1 circuits.\n"
            "  A layout needs one qubit per circuit.",
        ),
        (
            Program((), ("gate",)),
            {},
            "'gate' is not a valid name in OpenQASM 3.\n"
            "  It is reserved, is the name of a gate, or contains invalid characters.\n"
            "  Rename it.",
        ),
        (
            Program((), ("q",)),
            {},
            "'q' names a symbol and a register.\n  Rename one of them.",
        ),
    ],
)
def test_refusals(program, options, message):
    with pytest.raises(CircuitError) as caught:
        write(program, **options)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: Layout.default(2).on([1, 1]), "Qubit 1 is used twice."),
        (lambda: Layout.default(2).on([1]), "A layout has 1 qubits and 2 bits."),
        (lambda: Layout.default(1).on([-1]), "There is no physical qubit -1."),
        (lambda: Layout((Register("q", 1),) * 2, (), (), ()), "Register 'q' is used twice."),
        (lambda: Layout((), (), (("q", 0),), (None,)), r"No qubit register .* has q\[0\]."),
        (
            lambda: Layout((), (Register("c", 1),), (0,), (("c", 1),)),
            r"No bit register of the layout has c\[1\].",
        ),
    ],
)
def test_layouts_that_contradict_themselves_are_refused(change, message):
    with pytest.raises(CircuitError, match=message):
        change()


def test_writing_does_not_load_the_parser():
    code = (
        "import sys, qcompile.qasm; qcompile.qasm.write; "
        "assert not {'openqasm3', 'antlr4'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
