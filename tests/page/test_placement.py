"""The circuits of several qubits of a report, and where they are placed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rings import ring_gates, ring_policy

import qcompile
from qcompile.device import load_device
from qcompile.page.circuits import Compiled, circuits_section
from qcompile.page.document import Picture, Prose, Qubits, Table
from qcompile.page.placement import placement_section
from qcompile.policy import Policy


def compiled(device: str, tmp_path: Path) -> Compiled:
    """A ring of four qubits, and a circuit of one."""
    circuits = [{"qubits": 4, "gates": ring_gates(4)}, [["ry", "x0"]]]
    path = tmp_path / "ring.json"
    path.write_text(json.dumps(ring_policy(circuits=circuits, observables=[[0, 1], [4]])))
    policy = qcompile.load_policy(path)
    assert isinstance(policy, Policy)
    return Compiled(policy, load_device(device))


def test_wide_circuits_are_drawn_and_counted(tmp_path: Path) -> None:
    one = compiled("fake_lima", tmp_path)
    executable = one.executable()
    assert executable is not None
    prose, picture, table = circuits_section([one, one]).blocks
    assert isinstance(prose, Prose)
    assert prose.text.startswith("2 circuits on 5 qubits, compiled to rz sx x and cx. Level 2: ")
    assert isinstance(picture, Picture)
    assert "<circle" in picture.svg
    assert isinstance(table, Table)
    after = executable.native.circuits[0]
    counted = " + ".join(f"{n} {name}" for name, n in sorted(executable.gate_counts()[0].items()))
    assert table.rows[0] == [
        "0", "4", "<Z0 Z1>", "4 cz + 4 rx + 8 ry + 8 rz", counted,
        f"4 to {sum(gate.is_coupling for gate in after.gates)}", f"9 to {after.depth}",
    ]  # fmt: skip
    assert table.rows[1][:4] == ["1", "1", "<Z4>", "1 ry"]


def test_wide_circuits_are_drawn_for_each_device(tmp_path: Path) -> None:
    """They are routed for it; those of one qubit are the same on devices of the same gates."""
    devices = ("fake_lima", "fake_belem")
    pictures = [
        block.label
        for block in circuits_section([compiled(name, tmp_path) for name in devices]).blocks
        if isinstance(block, Picture)
    ]
    assert [label.split(",")[0] for label in pictures] == [f"Circuits for {d}" for d in devices]


def test_bits_and_couplings_have_their_places(tmp_path: Path) -> None:
    one = compiled("fake_lima", tmp_path)
    executable = one.executable()
    assert executable is not None
    picture, qubits, table = placement_section([one]).blocks
    assert isinstance(picture, Picture)
    assert isinstance(qubits, Qubits)
    assert isinstance(table, Table)
    assert picture.label == "Map of fake_lima"
    assert picture.text.startswith("In use: 5 qubits, 0, 1, 2, 3, 4; ")
    places = executable.bit_qubits.tolist()
    assert {t.qubit: t.circuits for t in qubits.tiles} == {
        place: f"bit {bit}" for bit, place in enumerate(places)
    }
    lima = one.device
    errors = {q: f"{50 * (x.p10 + x.p01):.2f} %" for q, x in enumerate(lima.qubits)}
    assert {tile.qubit: tile.error for tile in qubits.tiles} == errors
    times = sum(int(row[-1]) for row in table.rows)
    assert times == sum(gate.is_coupling for gate in executable.native.circuits[0].gates)
    known = {coupling.qubits: coupling for coupling in lima.couplings}
    for row in table.rows:
        first, second = map(int, row[0].split(","))
        found = known[first, second]
        assert row[1:4] == ["cx", f"{100 * found.error:.2f} %", f"{found.length_ns:.0f}"]


def test_beside_a_large_map_only_qubits_in_use_are_listed(tmp_path: Path) -> None:
    picture, qubits, _ = placement_section([compiled("fake_fez", tmp_path)]).blocks
    assert isinstance(picture, Picture)
    assert isinstance(qubits, Qubits)
    assert len(qubits.tiles) == 5
    assert qubits.label == "Qubits of fake_fez in use"


@pytest.mark.parametrize(("device", "has_map"), [("fake_lima", True), ("ibm_lima", False)])
def test_narrow_circuits_have_a_map_where_there_are_couplings(device: str, has_map: bool) -> None:
    policy = qcompile.load_policy("cartpole")
    blocks = placement_section([Compiled(policy, load_device(device))]).blocks
    assert [isinstance(block, Picture) for block in blocks] == [True] * has_map + [False]
