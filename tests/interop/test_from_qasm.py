"""OpenQASM as programs: from text or file, circuits in the order of bits, inputs by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from qiskit import qasm3
from qiskit.circuit import ParameterVector, QuantumCircuit

from qcompile.errors import ProgramFileError
from qcompile.ir import Program
from qcompile.simulate import Simulator

TEXT = """OPENQASM 3.0;
include "stdgates.inc";
input float[64] theta;
input float[64] x;
qubit[3] q;
bit[3] c;
ry(x) q[0];
rz(theta) q[1];
h q[2];
"""


def circuits(program: Program) -> list[str]:
    return list(map(str, program.circuits))


def test_text_and_files_are_distinguished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.qasm").write_text(TEXT)
    program = Program.from_qasm(TEXT)
    assert circuits(program) == ["ry(x)", "rz(theta)", "h"]
    assert (program.inputs, program.parameters) == (("x",), ("theta",))
    for way in ("mine.qasm", Path("mine.qasm")):
        assert Program.from_qasm(way) == program
    assert circuits(Program.from_qasm('OPENQASM 2.0; include "qelib1.inc"; qreg q[1]; h q[0];'))
    with pytest.raises(ProgramFileError, match=r"^nosuch\.qasm: The file cannot be read"):
        Program.from_qasm("nosuch.qasm")
    with pytest.raises(ProgramFileError, match=r"^<string>:10: ccx takes 3 qubits, found 2"):
        Program.from_qasm(TEXT + "ccx q[0], q[1];\n")


def test_measured_qubits_are_ordered_by_their_bits() -> None:
    measured = TEXT + "bit[2] a;\na[0] = measure q[0];\nc[1] = measure q[2];\n"
    assert circuits(Program.from_qasm(measured)) == ["h", "ry(x)"]


def test_inputs_are_chosen() -> None:
    program = Program.from_qasm(TEXT, inputs=["x", "theta"])
    assert (program.inputs, program.parameters) == (("x", "theta"), ())


def test_files_of_qiskit_equal_its_circuits() -> None:
    """Both doors give the same expectations, inputs and order."""
    x, theta = ParameterVector("x", 11), ParameterVector("theta", 11)
    circuit = QuantumCircuit(11, 11)
    for i in range(11):
        circuit.ry(x[i], i)
        circuit.rx(2 * theta[i], i)
    circuit.measure(range(11), reversed(range(11)))
    ways = [Program.from_qasm(qasm3.dumps(circuit)), Program.from_qiskit(circuit)]
    rng = np.random.default_rng(0)
    inputs, parameters = rng.normal(size=(3, 11)), rng.normal(size=11)
    by_hand = np.cos(inputs) * np.cos(2 * parameters)
    for way in ways:
        found = Simulator(way).expectation(inputs, parameters)
        np.testing.assert_allclose(found, by_hand[:, ::-1], atol=1e-12)
