"""Objects of other packages, where something else is needed: the message names the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from qiskit import QuantumCircuit

import qcompile
from qcompile.errors import CircuitError, DeviceError
from qcompile.snapshot import find_backend

qml = pytest.importorskip("pennylane")


class Own(QuantumCircuit):
    pass


@pytest.mark.parametrize(
    ("thing", "words"),
    [
        (QuantumCircuit(1), "a Qiskit circuit: Program.from_qiskit(circuit)"),
        (Own(1), "a Qiskit circuit: Program.from_qiskit(circuit)"),
        (
            qml.QNode(lambda: qml.expval(qml.Z(0)), qml.device("default.qubit")),
            "a PennyLane QNode: Program.from_pennylane(qnode, inputs=2, parameters=3)",
        ),
        (qml.tape.QuantumScript([]), "a PennyLane tape: Program.from_pennylane(tape)"),
        ("OPENQASM 3.0;", "a text: Program.from_qasm(text_or_path) reads OpenQASM"),
        (Path("a.qasm"), "a path: Program.from_qasm(text_or_path) reads OpenQASM"),
        (qcompile.load_policy("cartpole"), "an object of type Policy: give its .program"),
        (
            3,
            "an object of type int: "
            "Program.from_qiskit, Program.from_pennylane and Program.from_qasm make one",
        ),
    ],
)
def test_compile_names_the_door(thing: Any, words: str) -> None:
    with pytest.raises(CircuitError) as refused:
        qcompile.compile(thing)
    assert str(refused.value) == f"compile takes a Program; this is {words}"


def test_compile_names_the_door_of_devices() -> None:
    program = qcompile.Program(())
    with pytest.raises(DeviceError, match=r"this is a Qiskit backend: load_backend\(backend\)\.de"):
        qcompile.compile(program, find_backend("fake_lima"))  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match=r"this is a text: load_device\(name\)"):
        qcompile.compile(program, "fake_lima")  # type: ignore[arg-type]


def test_load_device_names_load_backend() -> None:
    with pytest.raises(DeviceError, match=r"a Qiskit backend\.\n  load_backend\(backend\)\.device"):
        qcompile.load_device(find_backend("fake_lima"))
