"""Gates of other vendors' files, against the published matrices."""

from __future__ import annotations

import cmath
import math
import re
from pathlib import Path

import numpy as np
import pytest

from qcompile.errors import ProgramFileError
from qcompile.ir import Angle, Circuit
from qcompile.qasm import read
from qcompile.qasm.gates import OTHER_GATES

A, B = 0.6, -1.3
ROOT = math.sqrt(0.5)


def turn(theta: float, phi: float) -> list[list[complex]]:
    """Braket's PRx and Quantinuum's U1q."""
    cos, sin = math.cos(theta / 2), -1j * math.sin(theta / 2)
    return [[cos, sin * cmath.exp(-1j * phi)], [sin * cmath.exp(1j * phi), cos]]


MATRICES = {
    "i": np.eye(2),
    "v": [[(1 + 1j) / 2, (1 - 1j) / 2], [(1 - 1j) / 2, (1 + 1j) / 2]],
    "vi": [[(1 - 1j) / 2, (1 + 1j) / 2], [(1 + 1j) / 2, (1 - 1j) / 2]],
    "si": [[1, 0], [0, -1j]],
    "ti": [[1, 0], [0, cmath.exp(-1j * math.pi / 4)]],
    f"phaseshift({A})": [[1, 0], [0, cmath.exp(1j * A)]],
    f"prx({A}, {B})": turn(A, B),
    f"U1q({A}, {B})": turn(A, B),
    f"Rz({A})": [[cmath.exp(-0.5j * A), 0], [0, cmath.exp(0.5j * A)]],
    f"gpi({A})": [[0, cmath.exp(-1j * A)], [cmath.exp(1j * A), 0]],
    f"gpi2({A})": [[ROOT, -1j * ROOT * cmath.exp(-1j * A)], [-1j * ROOT * cmath.exp(1j * A), ROOT]],
    f"gphase({A})": np.eye(2),
}


def unitary(circuit: Circuit) -> np.ndarray:
    """The product of the rotations of the gates, which tests/ir compares with Qiskit's matrices."""
    pauli = {"z": np.diag([1.0, -1.0]), "y": np.array([[0, -1j], [1j, 0]])}
    result = np.eye(2)
    for gate in circuit.gates:
        for axis, angle in gate.rotations:
            half = angle.constant / 2
            result = (math.cos(half) * np.eye(2) - 1j * math.sin(half) * pauli[axis]) @ result
    return result


@pytest.mark.parametrize("gate", MATRICES)
def test_gates_are_the_published_matrices_up_to_a_phase(gate):
    head = "OPENQASM 2.0;\nqreg q[1];\n" if "gphase" in gate else "OPENQASM 3.0;\nqubit[1] q;\n"
    found = unitary(read(f"{head}{gate} q[0];\n").program.circuits[0])
    expected = np.array(MATRICES[gate])
    overlap = np.trace(expected.conj().T @ found)
    assert abs(overlap) == pytest.approx(2)
    np.testing.assert_allclose(found * (2 / overlap), expected, atol=1e-12)


def test_a_file_of_braket_is_read():
    source = read(
        "OPENQASM 3.0;\nbit[2] b;\nqubit[2] q;\n#pragma braket verbatim\n"
        "box{\nv q[0];\nsi q[0];\n}\n"
        "#pragma braket result probability q[0]\nb[0] = measure q[0];\nb[1] = measure q[1];\n"
    )
    assert source.program.circuits == (Circuit.parse("sx sdg"), Circuit())
    assert source.notes == ("pragmas are skipped: '#pragma braket verbatim' on line 4 and 1 more.",)


def test_a_file_of_quantinuum_is_read():
    text = (
        'OPENQASM 2.0;\ninclude "hqslib1.inc";\nqreg q[1];\nU1q(0.5*pi,0.5*pi) q[0];\nx() q[0];\n'
    )
    circuit = read(text).program.circuits[0]
    np.testing.assert_allclose(
        np.abs(unitary(circuit)),
        np.abs(np.array([[0, 1], [1, 0]]) @ np.array(turn(math.pi / 2, 0))),
    )


def test_a_pragma_that_is_a_gate_is_not_skipped():
    with pytest.raises(ProgramFileError) as caught:
        read("qubit q;\n#pragma braket unitary([[0, 1], [1, 0]]) q\n", "p")
    assert str(caught.value).startswith("p:2: The pragma '#pragma braket unitary(")


def test_the_documentation_lists_every_gate():
    page = (Path(__file__).parents[2] / "docs/reference/qasm.md").read_text(encoding="utf-8")
    section = page.partition("## Gates")[2]
    rows = re.findall(r"^\| `([^`(]+)(?:\(([^)]*)\))?` \| (.+) \|$", section, re.MULTILINE)
    expected = [(gate.name, ", ".join(gate.parameters), gate.meaning) for gate in OTHER_GATES]
    assert rows == expected


@pytest.mark.parametrize("gate", OTHER_GATES, ids=lambda gate: gate.name)
def test_every_gate_of_the_table_takes_its_parameters(gate):
    angles = [Angle(0.1 * (k + 1)) for k in range(len(gate.parameters))]
    unitary = gate.unitary(angles)
    assert unitary.width == gate.qubits + gate.controls
    assert {q for part in unitary.gates for q in part.qubits} <= {*range(unitary.width)}
