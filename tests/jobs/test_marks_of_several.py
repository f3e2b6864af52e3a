"""Barriers, delays and resets at level 0 keep their places among gates that connect qubits."""

from __future__ import annotations

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm3
from several import measured, random_qiskit

from qcompile.device import IDEAL, load_device
from qcompile.errors import CircuitError
from qcompile.jobs.program_file import compile_source
from qcompile.qasm import read

DEVICES = [IDEAL, *map(load_device, ("fake_lima", "fake_jakarta", "fake_fez"))]
HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'


def turned(text: str) -> tuple[QuantumCircuit, list[str]]:
    """The circuit of a file with a turn for every qubit of every mark, and the marks.

    The angle tells a mark, and a qubit's place in it, from others.
    """
    circuit = qasm3.loads(text)
    made, marks = QuantumCircuit(circuit.num_qubits, circuit.num_clbits), []
    done: set[int] = set()
    for item in circuit.data:
        operation = item.operation
        qubits = [circuit.find_bit(qubit).index for qubit in item.qubits]
        if operation.name == "measure":
            made.measure(qubits, [circuit.find_bit(bit).index for bit in item.clbits])
            done.update(qubits)
        elif operation.name in ("barrier", "delay", "reset"):
            own = operation.duration * 0.013 if operation.name == "delay" else 0.31 * len(qubits)
            for place, qubit in enumerate(qubits):
                if qubit not in done:
                    made.rz(own + 0.17 * place, qubit)
            marks.append(operation.name)
        else:
            made.append(operation, qubits)
    return made, sorted(marks)


def random_file(seed: int) -> str:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    circuit = QuantumCircuit(count, count)
    if seed % 2:
        circuit.reset(range(count))
    for part in range(4):
        circuit.compose(random_qiskit(rng, count), inplace=True)
        some = rng.choice(count, int(rng.integers(1, count + 1)), replace=False).tolist()
        if rng.random() < 0.7:
            circuit.barrier(some)
        else:
            circuit.delay(100 + part, some[0], unit="ns")
    circuit.h(range(count))
    circuit.rx(0.4, range(count))
    if seed % 3:
        circuit.barrier()
    circuit.measure(range(count), range(count))
    return str(qasm3.dumps(circuit))


@pytest.mark.parametrize("seed", range(6))
def test_marks_keep_their_places_where_circuits_are_routed(seed: int) -> None:
    text = random_file(seed)
    circuit, marks = turned(text)
    _, wanted = measured(circuit)
    for device in DEVICES:
        found, kept = turned(compile_source(read(text), device, 0, "3").text)
        assert kept == marks
        np.testing.assert_allclose(measured(found)[1], wanted, atol=1e-9)


def test_the_check_sees_a_mark_in_another_place() -> None:
    text = HEAD + "qubit[2] q;\nbit[2] c;\nh q;\nbarrier q;\nh q;\ncx q[0], q[1];\nc = measure q;\n"
    other = text.replace("barrier q;\nh q;\n", "h q;\nbarrier q;\n")
    first, second = (measured(turned(each)[0])[1] for each in (text, other))
    assert np.abs(first - second).max() > 0.1


def test_marks_across_circuits_and_after_measurements() -> None:
    text = HEAD + (
        "qubit[4] q;\nbit[4] c;\nh q[0];\ncx q[0], q[2];\nbarrier q[2], q[1], q[3];\nx q[1];\n"
        "c[2] = measure q[2];\ndelay[10ns] q[2];\nbarrier q;\nh q[0];\nid q[3];\n"
        "c[0] = measure q[0];\nc[1] = measure q[1];\n"
    )
    for device in DEVICES:
        made = compile_source(read(text), device, 0, "3")
        assert made.notes == ()
        lines = made.text.splitlines()
        assert sum(line.startswith("barrier") for line in lines) == 2
        measurement = next(i for i, line in enumerate(lines) if line.startswith("c[2] = measure"))
        delay = next(i for i, line in enumerate(lines) if line.startswith("delay[10ns]"))
        last = max(i for i, line in enumerate(lines) if line.startswith("barrier"))
        assert measurement < delay < last
        found, _ = turned(made.text)
        np.testing.assert_allclose(measured(found)[1], measured(turned(text)[0])[1], atol=1e-9)


def test_marks_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qcompile.jobs.marks.MAX_KEPT", 100)
    text = HEAD + "qubit[20] q;\nbit[2] c;\n{}" + "barrier q;\n" * 6 + "c = measure q[0:1];\n"
    with pytest.raises(CircuitError, match=r"name more than 100 qubits in all\.\n.*--level 1"):
        compile_source(
            read(text.format("cx q, q[1];\n" and "cx q[0:18], q[1:19];\n")), IDEAL, 0, "3"
        )
    assert compile_source(read(text.format("h q;\n")), IDEAL, 0, "3").notes == ()
