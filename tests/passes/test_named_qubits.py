"""Programs compiled onto qubits that the caller names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.errors import CircuitError, DeviceError
from qcompile.ir import Circuit, Program

NARROW = Program.of([Circuit.parse("ry(x0)"), Circuit.parse("h rz(x0)")], 1)
WIDE = Program.of([Circuit.parse("ry(x0)@0 cz@0,1 h@1 cx@1,0", 2), Circuit.parse("ry(x0)")], 1)
LIMA = qcompile.load_device("fake_lima")
X, THETA = np.array([[0.3], [-1.2]]), np.zeros(0)


@pytest.mark.parametrize("program", [NARROW, WIDE])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_every_bit_is_where_it_was_put(program: Program, level: int) -> None:
    qubits = [3, 4, 0][: program.bits]
    executable = qcompile.compile(program, LIMA, level, qubits=qubits)
    assert executable.bit_qubits.tolist() == executable.qubits.tolist() == qubits
    assert executable.round_count == 1
    ideal = qcompile.compile(program, level=level, qubits=[7, 1, 30][: program.bits])
    assert ideal.qubits.tolist() == [7, 1, 30][: program.bits]
    exact = qcompile.OfflineExecutor(ideal.device).expectation(ideal, X, THETA)
    noisy = qcompile.OfflineExecutor(LIMA).expectation(executable, X, THETA)
    assert 1e-3 < np.abs(noisy - exact).max() < 0.2


def test_without_names_the_best_qubits_are_taken_as_before() -> None:
    assert qcompile.compile(NARROW, LIMA).qubits.tolist() == [2, 1]


@pytest.mark.parametrize(
    ("program", "options", "words"),
    [
        (WIDE, {"qubits": [3, 4]}, "2 different qubits do not fit 3 bits"),
        (WIDE, {"qubits": [3, 4, 4]}, "2 different qubits do not fit 3 bits"),
        (NARROW, {"qubits": [3, 4], "copies": 2}, "2 different qubits do not fit 4 bits"),
        (NARROW, {"qubits": [0, 5]}, r"fake_lima has no qubit 5\.\n  Its qubits are 0 to 4"),
        (NARROW, {"qubits": [0, -1]}, r"fake_lima has no qubit -1"),
    ],
)
def test_names_that_do_not_fit_are_refused(
    program: Program, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(CircuitError, match=words):
        qcompile.compile(program, LIMA, **options)


def test_a_missing_coupling_is_named() -> None:
    with pytest.raises(DeviceError, match="fake_lima does not couple qubits 0 and 4, which cz"):
        qcompile.compile(WIDE, LIMA, 1, qubits=[0, 4, 2])
