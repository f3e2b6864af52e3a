"""Objects of other packages in the wrong place: the message says how to convert them."""

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
        (QuantumCircuit(1), "a Qiskit circuit.\n  Use Program.from_qiskit(circuit)."),
        (Own(1), "a Qiskit circuit.\n  Use Program.from_qiskit(circuit)."),
        (
            qml.QNode(lambda: qml.expval(qml.Z(0)), qml.device("default.qubit")),
            "a PennyLane QNode.\n  Use Program.from_pennylane(qnode, inputs=2, parameters=3).",
        ),
        (qml.tape.QuantumScript([]), "a PennyLane tape.\n  Use Program.from_pennylane(tape)."),
        ("OPENQASM 3.0;", "a string.\n  Use Program.from_qasm(text_or_path) for OpenQASM."),
        (Path("a.qasm"), "a path.\n  Use Program.from_qasm(text_or_path) for OpenQASM."),
        (qcompile.load_policy("cartpole"), "an object of type Policy.\n  Pass its .program."),
        (
            3,
            "an object of type int.\n  "
            "Use Program.from_qiskit, Program.from_pennylane or Program.from_qasm.",
        ),
    ],
)
def test_compile_suggests_how_to_make_a_program(thing: Any, words: str) -> None:
    with pytest.raises(CircuitError) as refused:
        qcompile.compile(thing)
    assert str(refused.value) == f"compile takes a Program, found {words}"


def test_compile_suggests_how_to_load_a_device() -> None:
    program = qcompile.Program(())
    with pytest.raises(
        DeviceError, match=r"found a Qiskit backend\.\n  Use load_backend\(backend\)\.device"
    ):
        qcompile.compile(program, find_backend("fake_lima"))  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match=r"found a string\.\n  Use load_device\(name\)"):
        qcompile.compile(program, "fake_lima")  # type: ignore[arg-type]


def test_load_device_names_load_backend() -> None:
    with pytest.raises(
        DeviceError, match=r"a Qiskit backend\.\n  Use load_backend\(backend\)\.device"
    ):
        qcompile.load_device(find_backend("fake_lima"))
