"""The circuits of a report: each shape once, each circuit on its qubit."""

from __future__ import annotations

from pathlib import Path

import pytest
from page.conftest import hostile_policy

import qcompile
from qcompile.device import load_device
from qcompile.ir import Circuit, Program
from qcompile.page.circuits import Compiled, circuits_section, placement_section, shapes
from qcompile.page.document import Code, Prose, Qubits


@pytest.mark.parametrize(
    ("circuits", "groups"),
    [
        (["h ry(x0)", "h ry(x1)", "h ry(2*x1+0.5)"], [[0, 1, 2]]),
        (["h ry(x0)", "h rz(x0)", "h"], [[0], [1], [2]]),
        (["ry(x0)", "ry(theta0)", "ry(0.5)"], [[0], [1], [2]]),
        (["ry(x0) rz(x0)", "ry(x0) rz(x1)", "ry(x1) rz(x1)"], [[0, 2], [1]]),
        (["rz(0.1)", "rz(0.2)"], [[0, 1]]),
    ],
)
def test_circuits_of_one_shape_differ_by_numbers_and_names(
    circuits: list[str], groups: list[list[int]]
) -> None:
    program = Program.of(map(Circuit.parse, circuits), inputs=2, parameters=1)
    assert shapes(program) == groups


def test_one_circuit_of_each_shape_is_shown() -> None:
    policy = qcompile.load_policy("lunarlander")
    section = circuits_section([Compiled(policy, load_device("ibm_lima"))])
    prose, code, *_ = section.blocks
    assert isinstance(prose, Prose)
    assert prose.text.startswith("24 circuits of 1 shape, compiled to rz sx x at level 2")
    assert isinstance(code, Code)
    assert code.label == "Circuits 0 to 23, circuit 0 shown"
    assert "ry(theta0)" in code.text
    assert "ry(theta1)" not in code.text


def test_each_circuit_is_on_its_qubit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `qcompile show` places it; copies of a circuit are that circuit."""
    monkeypatch.chdir(tmp_path)
    policy, device = hostile_policy(), load_device("ibm_toronto")
    for copies in (1, 3):
        (block,) = placement_section([Compiled(policy, device, copies=copies)]).blocks
        assert isinstance(block, Qubits)
        assert [tile.qubit for tile in block.tiles] == list(range(27))
        placed = [tile for tile in block.tiles if tile.circuits]
        assert len(placed) == 4 * copies
        assert {tile.circuits for tile in placed} == {f"circuit {index}" for index in range(4)}


def test_the_ideal_device_has_no_placement() -> None:
    policy = qcompile.load_policy("cartpole")
    assert placement_section([Compiled(policy, load_device("ideal"))]).blocks == []
