"""Compiled program files: the placement of qubits, and statements other than gates."""

from __future__ import annotations

import random

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm3
from qiskit.quantum_info import Operator

from qcompile.device import IDEAL, load_device
from qcompile.errors import DeviceError
from qcompile.jobs.program_file import CompiledFile, compile_source
from qcompile.passes import LEVELS
from qcompile.qasm import read
from qcompile.simulate import Simulator

HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'


def compiled(text: str, device: str = "ideal", level: int = 2, version: str = "3") -> CompiledFile:
    found = IDEAL if device == "ideal" else load_device(device)
    return compile_source(read(text), found, level, version)  # type: ignore[arg-type]


def body(made: CompiledFile) -> list[str]:
    return made.text.splitlines()[2:]


IDLE = HEAD_2 + "qreg q[5];\ncreg c[5];\nh q[3];\nmeasure q[3] -> c[0];\n"


@pytest.mark.parametrize("level", LEVELS)
def test_one_qubit_in_use_of_five_needs_one(level: int) -> None:
    made = compiled(IDLE, "fake_lagos", level)  # two of its qubits are worth using
    assert made.notes == ()
    assert (len(made.executable.native), made.circuits) == (1, (3,))
    (qubit,) = made.executable.qubits.tolist()
    assert made.text.startswith(HEAD + "bit[5] c;\n")
    assert made.text.endswith(f"c[0] = measure ${qubit};\n")
    alone = compiled(IDLE, level=level)
    assert body(alone)[:2] == ["qubit[5] q;", "bit[5] c;"]
    assert read(alone.text).layout.bits[3] == ("c", 0)


def test_openqasm_2_says_where_the_qubits_in_use_go() -> None:
    made = compiled(IDLE, "fake_lagos", version="2")
    (qubit,) = made.executable.qubits.tolist()
    note = f"OpenQASM 2 cannot name physical qubits: place q[3] on {qubit}."
    assert made.notes == (note,)


def test_a_qubit_that_is_measured_needs_a_place_without_gates() -> None:
    text = HEAD + "qubit[3] q;\nbit[3] c;\nx q[0];\nc = measure q;\n"
    assert compiled(text).circuits == (0, 1, 2)
    with pytest.raises(DeviceError, match="It needs 3 qubits at once"):
        compiled(text, "fake_lagos")


def test_only_gates_that_are_dropped_are_told_of() -> None:
    text = HEAD + "qubit[4] q;\nbit[4] c;\nh q[0];\nx q[2];\nc[0] = measure q[0];\n"
    made = compiled(text)
    assert made.notes == ("1 qubit(s) are not measured: their gates are dropped.",)
    assert made.circuits == (0,)
    for level in (0, 1):
        made = compiled(text, level=level)
        assert (made.notes, made.circuits) == ((), (0, 2))


BESIDE = (
    HEAD + "qubit[3] q;\nbit[3] c;\nreset q;\nx q[0];\nbarrier q[0], q[1];\nid q[0];\nid q[0];\n"
    "delay[100ns] q[0], q[1];\nh q[1];\nc[0] = measure q[0];\nbarrier q;\nx q[1];\n"
    "c[1] = measure q[1];\n"
)


def test_level_0_keeps_what_is_no_gate_in_its_place() -> None:
    made = compiled(BESIDE, level=0)
    assert made.notes == ()
    assert body(made) == [
        *(
            "qubit[3] q;",
            "bit[3] c;",
            "reset q[0];",
            "reset q[1];",
            "x q[0];",
            "barrier q[0], q[1];",
        ),
        *("id q[0];", "id q[0];", "delay[100ns] q[0], q[1];", "c[0] = measure q[0];"),
        *("rz(pi/2) q[1];", "sx q[1];", "rz(pi/2) q[1];", "barrier q[0], q[1];", "x q[1];"),
        "c[1] = measure q[1];",
    ]
    assert qasm3.loads(made.text).count_ops()["reset"] == 2
    physical = compiled(BESIDE, "ibm_lima", level=0)
    first, second = physical.executable.qubits.tolist()
    assert f"barrier ${first}, ${second};" in body(physical)


@pytest.mark.parametrize("level", [1, 2])
def test_the_other_levels_tell_what_went(level: int) -> None:
    made = compiled(BESIDE, level=level)
    assert made.notes == (
        f"level {level} leaves out 2 reset, 2 barrier, 1 delay, 2 id; level 0 keeps them.",
    )
    assert not {"reset", "barrier", "delay", "id"} & {line.split()[0] for line in body(made)}


def test_openqasm_2_has_no_delay() -> None:
    made = compiled(BESIDE, level=0, version="2")
    assert made.notes == ("OpenQASM 2 has no delay: 1 delay left out.",)
    assert "id q[0];" in body(made)


def test_durations_have_names_and_barriers_in_gates_are_told_of() -> None:
    text = HEAD + (
        "gate g a { x a; barrier a; x a; }\nconst duration d = 1.5us;\nduration e = 3dt;\n"
        "qubit q;\nbit c;\ng q;\ndelay[d] q;\ndelay[e];\nc = measure q;\ndelay[2ms] q;\n"
    )
    made = compiled(text, level=0)
    assert made.notes == ("barriers within gate definitions are left out.",)
    assert body(made)[2:] == [
        *("x q;", "x q;", "delay[1.5us] q;", "delay[3dt] q;", "c = measure q;", "delay[2ms] q;")
    ]


def segments(circuit: QuantumCircuit) -> list[list[object]]:
    """For each qubit: unitaries, separated by the names of other instructions."""
    found: list[list[object]] = [[np.eye(2)] for _ in circuit.qubits]
    for item in circuit.data:
        for qubit in item.qubits:
            own = found[circuit.find_bit(qubit).index]
            if item.operation.name in ("reset", "barrier", "delay", "id", "measure"):
                own += [item.operation.name, np.eye(2)]
            else:
                own[-1] = Operator(item.operation).data @ own[-1]
    return found


def test_qiskit_reads_the_same_order_from_what_level_0_writes() -> None:
    rng = random.Random(7)
    lines = ["reset q[1];"]
    for _ in range(60):
        qubits = rng.sample(range(3), rng.randint(1, 3))
        named = ", ".join(f"q[{qubit}]" for qubit in qubits)
        gate = rng.choice(["h", "x", "sx", "t", "rx(0.3)", "ry(-1.2)", "id"])
        barrier, delay = f"barrier {named};", f"delay[20ns] q[{qubits[0]}];"
        lines.append(rng.choice([barrier, delay, *[f"{gate} q[{qubits[0]}];"] * 4]))
    text = HEAD + "qubit[3] q;\nbit[3] c;\n" + "\n".join(lines) + "\nc = measure q;\n"
    before, after = (qasm3.loads(t) for t in (text, compiled(text, level=0).text))
    for ours, theirs in zip(segments(after), segments(before), strict=True):
        assert ours[1::2] == theirs[1::2]
        for one, two in zip(ours[::2], theirs[::2], strict=True):
            assert abs(abs(np.trace(np.conj(one).T @ two)) - 2) < 1e-10  # up to global phase


@pytest.mark.parametrize("version", ["3", "2"])
@pytest.mark.parametrize("level", LEVELS)
def test_a_measurement_repeated_at_once_gives_the_same_value(level: int, version: str) -> None:
    text = HEAD + (
        "qubit q;\nbit[3] c;\nx q;\nc[0] = measure q;\nbarrier q;\nc[0] = measure q;\n"
        "c[2] = measure q;\nc[2] = measure q;\n"
    )
    made = compiled(text, level=level, version=version)
    layout = read(made.text).layout
    assert (layout.bits, layout.again) == ((("c", 0),), ((0, ("c", 2)),))
    from qiskit_aer import AerSimulator

    loads = qasm3.loads if version == "3" else QuantumCircuit.from_qasm_str
    counts = AerSimulator().run(loads(made.text), shots=10).result().get_counts()
    assert counts == {"101": 10}


def test_slots_have_names_that_the_file_does_not_use() -> None:
    text = HEAD + (
        "input float a0_0;\ninput float x;\nqubit[2] a1_0;\nbit c;\nh a1_0[1];\nrz(x) a1_0[1];\n"
        "ry(a0_0) a1_0[1];\nc = measure a1_0[1];\n"
    )
    made = compiled(text)
    assert "input float[64] a_1_0;" in body(made)
    program = read(made.text).program
    x = np.array([[0.3, 0.4], [1.2, -0.7]])
    slots = made.executable.bind(x, np.zeros(0))
    found = Simulator(program).expectation(slots, np.zeros(0))[:, 1]
    wanted = Simulator(read(text).program).expectation(x, np.zeros(0))[:, 1]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_an_empty_register_on_a_device_compiles_to_nothing() -> None:
    for level in (0, 1):
        made = compiled(HEAD + "qubit[3] q;\n", "ibm_lima", level)
        assert (made.circuits, body(made)) == ((), [])
