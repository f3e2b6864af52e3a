"""The digest of a job: equal for equal measurements, and for no others."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit import ClassicalRegister, QuantumCircuit, QuantumRegister
from qiskit.circuit import Gate, Parameter, ParameterVector

from qcompile.errors import LiveError
from qcompile.live.pubs import Call
from qcompile.live.request import is_same

X = np.array([[0.25, -0.5], [1.0, 2.0]])


def circuit(
    change: Callable[[QuantumCircuit], object] = lambda made: None,
    *,
    names: tuple[str, str] = ("b", "a"),
    register: str = "c",
) -> QuantumCircuit:
    """rz(b) on qubit 0 and rz(2 a) on qubit 2, with 0.1 in between, read into a register."""
    made = QuantumCircuit(QuantumRegister(3, "q"), ClassicalRegister(2, register))
    first, second = map(Parameter, names)
    made.sx(0)
    made.rz(first, 0)
    made.rz(0.1, 1)
    made.rz(2 * second, 2)
    change(made)
    made.measure([0, 2], [1, 0])
    return made


def digest(made: QuantumCircuit, values: Any = X, shots: int = 100) -> str:
    (request,) = Call([(made, values)], shots).requests
    return request.digest


def test_it_is_of_the_circuit_its_values_and_its_shots() -> None:
    """The text is written here by hand: no version of Qiskit may change it."""
    text = (
        "3 [('c', [0, 1])] ['a', 'b']\n"
        "sx [] ([0], []) None\n"
        "rz ['b'] ([0], []) None\n"
        "rz ['(0.1+0j)'] ([1], []) None\n"
        "rz ['2*a'] ([2], []) None\n"
        "measure [] ([0], [1]) None\n"
        "measure [] ([2], [0]) None\n"
        "(2, 2) 100\n"
    )
    expected = hashlib.sha256(text.encode() + X.astype("<f8").tobytes()).hexdigest()
    assert digest(circuit()) == f"pubs-1 {expected}"


OTHERS: dict[str, Callable[[], str]] = {
    "shots": lambda: digest(circuit(), shots=101),
    "a value": lambda: digest(circuit(), X + np.array([[0, 0], [0, 1e-8]])),
    "the shape": lambda: digest(circuit(), X[None]),
    "a row less": lambda: digest(circuit(), X[:1]),
    "names": lambda: digest(circuit(names=("a", "b"))),
    "the register": lambda: digest(circuit(register="d")),
    "a gate more": lambda: digest(circuit(lambda made: made.x(1))),
    "another qubit": lambda: digest(circuit(lambda made: made.x(0))),
    "a barrier": lambda: digest(circuit(lambda made: made.barrier(1))),
    "a delay": lambda: digest(circuit(lambda made: made.delay(10, 1, unit="dt"))),
    "a longer delay": lambda: digest(circuit(lambda made: made.delay(10, 1, unit="ns"))),
    "a gate of one's own": lambda: digest(circuit(lambda made: made.append(own("x"), [1]))),
    "another of that name": lambda: digest(circuit(lambda made: made.append(own("y"), [1]))),
    "a branch": lambda: digest(circuit(branch(0))),
    "another branch": lambda: digest(circuit(branch(1))),
}


def own(inside: str) -> Gate:
    made = QuantumCircuit(1)
    getattr(made, inside)(0)
    gate = made.to_gate()
    gate.name = "mine"
    return gate


def branch(value: int) -> Callable[[QuantumCircuit], object]:
    def change(made: QuantumCircuit) -> None:
        made.measure(1, 0)
        with made.if_test((made.clbits[0], value)):
            made.x(2)

    return change


def test_another_job_has_another_one() -> None:
    found = [digest(circuit()), *(make() for make in OTHERS.values())]
    assert len(set(found)) == len(found)


def test_what_another_processor_rounds_otherwise_is_the_same() -> None:
    """0 and -0 are equal."""
    assert digest(circuit(), X + 1e-13) == digest(circuit())
    assert digest(circuit(), X * 0.0) == digest(circuit(), X * -0.0)


def test_the_names_of_things_that_are_not_measured_do_not_count() -> None:
    made = circuit()
    made.name, made.metadata = "another", {"who": "me"}
    assert digest(made) == digest(circuit())


def test_values_by_name_are_those_in_order() -> None:
    """Parameters are in order of their names, those of a vector in order of their numbers."""
    made = circuit()
    by_name = {"b": X[:, 1], "a": X[:, 0]}
    assert digest(made, by_name) == digest(made, X)
    vector = ParameterVector("v", 11)
    several = QuantumCircuit(1, 1)
    for parameter in vector:
        several.rz(parameter, 0)
    several.measure(0, 0)
    values = np.arange(11.0)
    assert digest(several, {vector: values}) == digest(several, values)


def test_another_process_finds_the_same() -> None:
    """Qiskit gives its parameters new identities in each."""
    code = "from live.test_digest import circuit, digest; print(digest(circuit()))"
    folder = Path(__file__).parent.parent
    found = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(folder)!r}); {code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == digest(circuit())


def test_control_flow_that_has_no_openqasm_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from qiskit.qasm3 import QASM3ExporterError

    def fail(made: QuantumCircuit) -> str:
        raise QASM3ExporterError("not that")

    monkeypatch.setattr("qiskit.qasm3.dumps", fail)
    with pytest.raises(LiveError, match=r"(?s)cannot be written as OpenQASM 3.*not that"):
        digest(circuit(branch(0)))


def test_a_digest_of_an_earlier_version_says_nothing() -> None:
    assert is_same("4f46e14468fbf3d3d16efe493982ab3e", "pubs-1 a")
    assert is_same("pubs-1 a", "pubs-1 a")
    assert not is_same("pubs-1 b", "pubs-1 a")
