"""Circuits to train: their sources, their files, and refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit.circuit import Parameter, QuantumCircuit

import qcompile
from qcompile import Ansatz, Circuit, Encoder, Policy, Program
from qcompile.errors import PolicyError, QcompileError
from qcompile.policy import load_ansatz
from qcompile.policy.ansatz_file import ansatz_text, read_ansatz

PROGRAM = Program.parse("inputs b a unused\nparameters w v\n0: ry(a) rz(w) ry(0.5*b-v+pi/3)\n1: h")


def factored(*, alone: bool = False) -> Ansatz:
    """An input times a factor, and a shift; then the input itself, unless it stands `alone`."""
    s, t, x = map(Parameter, "stx")
    circuit = QuantumCircuit(1)
    circuit.ry(s * x + t, 0)
    if not alone:
        circuit.rz(x, 0)
    return Ansatz.from_qiskit(circuit)


def policy(**changes: Any) -> Policy:
    encoder = Encoder(
        ("tanh", "clip"),
        np.array([3, 1]),
        np.array([-2.0, 0.0]),
        gain=np.array([1.5, 1.0]),
        mean=np.arange(4.0),
        std=np.arange(1.0, 5.0),
    )
    program = Program.parse("inputs b a\nparameters w\n0: ry(a) rz(w)\n1: rx(b)")
    numbers = np.random.default_rng(0).normal(size=(2, 4))
    values = Policy("mine", "CartPole-v1", encoder, program, np.ones(1), numbers, np.ones(2), 2)
    return replace(values, **changes)


def same(one: Ansatz, other: Ansatz) -> None:
    assert ansatz_text(one) == ansatz_text(other)
    assert one.program == other.program
    assert (one.inputs, one.parameters) == (other.inputs, other.parameters)


def test_a_program_is_read_with_its_names() -> None:
    ansatz = Ansatz.of_program(PROGRAM)
    assert (ansatz.inputs, ansatz.parameters) == (("b", "a", "unused"), ("w", "v"))
    assert str(ansatz.program.circuits[0]) == "ry(x1) rz(theta0) ry(-theta1+0.5*x0+pi/3)"
    assert (ansatz.reads.tolist(), ansatz.factors.tolist()) == ([0, 1], [-1, -1])
    assert ansatz.encoder is ansatz.theta is ansatz.weights is None
    assert str(ansatz).splitlines()[2] == "0: ry(a) rz(w) ry(-v+0.5*b+pi/3)"


def test_a_policy_gives_encoder_and_numbers_and_its_head_if_asked() -> None:
    own = policy()
    ansatz = Ansatz.of_policy(own)
    assert ansatz.encoder is own.encoder
    assert ansatz.theta is not None
    np.testing.assert_array_equal(ansatz.theta, own.theta)
    assert ansatz.weights is ansatz.bias is None
    head = Ansatz.of_policy(own, head=True)
    assert head.weights is not None
    np.testing.assert_allclose(head.weights, own.weights[:, :2] + own.weights[:, 2:])
    assert head.without_numbers.theta is head.without_numbers.bias is None


@pytest.mark.parametrize(
    "ansatz",
    [Ansatz.of_program(PROGRAM), factored(), Ansatz.of_policy(policy(), head=True)],
    ids=["program", "factors", "policy"],
)
def test_a_file_gives_them_back(ansatz: Ansatz, tmp_path: Path) -> None:
    ansatz.save(path := tmp_path / "own.json")
    again = load_ansatz(path)
    same(again, ansatz)
    if ansatz.encoder is not None and again.encoder is not None:
        x = np.random.default_rng(1).normal(size=(3, 4))
        np.testing.assert_array_equal(again.encoder(x), ansatz.encoder(x))


def test_a_file_of_circuits_alone_is_enough() -> None:
    text = '{"format": "qcompile-ansatz-1", "circuits": [[["ry", "x2"], ["rz", "theta1"]]]}'
    ansatz = read_ansatz(text)
    assert ansatz.inputs == ("x0", "x1", "x2")
    assert ansatz.parameters == ("theta0", "theta1")


def test_what_stands_for_circuits(tmp_path: Path) -> None:
    circuit = QuantumCircuit(1)
    circuit.ry(Parameter("x"), 0)
    head = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
    gates = "input float x;\ninput float s;\nqubit q;\nry(s*x) q;\n"
    (tmp_path / "own.qasm").write_text(head + gates)
    qcompile.save_policy(policy(), tmp_path / "p.pt")
    origins = {
        "a Program": PROGRAM,
        "a Qiskit circuit": circuit,
        "policy mine": policy(),
        "policy cartpole": "cartpole",
        "OpenQASM own.qasm": tmp_path / "own.qasm",
    }
    for origin, source in origins.items():
        assert load_ansatz(source).origin == origin
    assert load_ansatz(str(tmp_path / "p.pt")).origin == "policy mine"
    ansatz = factored()
    assert load_ansatz(ansatz) is ansatz


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("cartpol", "There is no file or policy cartpol.\n  Did you mean cartpole"),
        ("none.qasm", "There is no file or policy none.qasm"),
        ("none.pt", "Unknown policy 'none.pt'"),
        (3, "circuits cannot be an object of type int"),
        (Program.parse("parameters a\n0: ry(a)"), "need an input: 1 circuit reads 0"),
        (Program(()), "need an input: 0 circuits read 0"),
    ],
)
def test_what_does_not_stand_for_circuits(source: Any, words: str) -> None:
    with pytest.raises(QcompileError) as caught:
        load_ansatz(source)
    assert words in str(caught.value)


def test_a_compiled_program_is_refused() -> None:
    device = qcompile.load_device("fake_lima")
    program = Program.of([Circuit.parse("h ry(x0) rz(x0) ry(theta0)")], 1, 1)
    with pytest.raises(PolicyError, match="compiled program cannot be trained"):
        Ansatz.of_program(qcompile.compile(program, device).native)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"circuits": []}, "circuits: list should have at least 1 item"),
        ({"circuits": [[["ry", "x0*x1"]]]}, "not an affine angle"),
        ({"circuits": [[["cx", "x0"]]]}, "Gate 'cx' takes no angle"),
        ({"circuits": [[["ry", "y"]]]}, "Unknown symbol 'y'"),
        ({"reads": [5]}, "reads contains a number outside 0 to 0"),
        ({"factors": [7]}, "factors contains a number outside -1 to 1"),
        ({"reads": [0, 0]}, "factors has shape (1,).\n  It needs (2,)"),
        ({"theta": [0.5]}, "theta has shape (1,).\n  It needs (2,)"),
        ({"parameters": ["a"]}, "Unknown symbol 'theta1'"),
        ({"encoder": {"function": "sin", "feature": [0], "scale": [1.0]}}, "encoder.function"),
        (
            {"encoder": {"function": "tanh", "feature": [0, 1], "scale": [1.0, 1.0]}},
            "encoder.scale",
        ),
        ({"weights": [[1.0], [1.0, 2.0]], "bias": [0.0, 0.0]}, "rows of different lengths"),
        ({"weights": [[1.0, 2.0]], "bias": [0.0]}, "weights has shape (1, 2).\n  It needs (1, 1)"),
        ({"origin": "two\nlines"}, "origin"),
        ({"unheard": 1}, "unheard"),
    ],
)
def test_a_bad_file_is_refused(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text(json.dumps(json.loads(ansatz_text(factored(alone=True))) | changes))
    with pytest.raises(PolicyError) as caught:
        load_ansatz(path)
    message = str(caught.value).replace("\n    ", "\n  ")
    assert message.startswith(f"{path} is not a file of circuits.")
    assert words.replace("\n", "") in message.replace("\n", "")


def test_other_names_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"own\.txt is not the name of a file of circuits"):
        factored().save(tmp_path / "own.txt")
