"""The circuits of a report: each shape once, each circuit on its qubit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from page.conftest import hostile_policy

import qcompile
from qcompile.device import Device, Qubit, load_device
from qcompile.page.circuits import Compiled, circuits_section
from qcompile.page.document import Heading, Picture, Prose, Qubits
from qcompile.page.placement import placement_section
from qcompile.policy import Dense, Network
from qcompile.report.wires import executable_values


def test_circuits_are_drawn_before_and_after() -> None:
    policy, device = qcompile.load_policy("lunarlander"), load_device("ibm_lima")
    prose, picture = circuits_section([Compiled(policy, device), Compiled(policy, device)]).blocks
    assert isinstance(prose, Prose)
    assert prose.text.startswith("24 circuits, compiled to rz sx x. Level 2: ")
    assert isinstance(picture, Picture)
    assert picture.svg.count("<rect") == 9, "h ry rz ry M, and sx rz sx M"
    assert "circuit 0  |0>─ h ─ ry(x0) ─ rz(x0) ─ ry(theta0) ─ M" in picture.spoken
    assert "24 circuits of its shape" in picture.spoken
    assert picture.text.startswith("polar{gates}: the angle between |0> and the state")


def test_policies_have_titles_and_networks_no_circuits() -> None:
    policy = qcompile.load_policy("cartpole")
    assert isinstance(policy, qcompile.Policy)
    device = load_device("ibm_lima")
    dense = Dense(np.ones((2, 4)), np.zeros(2))
    network = Network("net", "CartPole-v1", [dense])
    blocks = circuits_section([Compiled(policy, device), Compiled(network, device)]).blocks
    assert [block.text for block in blocks if isinstance(block, Heading)] == ["cartpole", "net"]
    assert isinstance(blocks[-1], Prose)
    assert blocks[-1].text.startswith("A network: it has no circuits")


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


@pytest.mark.parametrize(("shots", "stated"), [(None, 1024), (1024, 1024), (64, 64), (8192, 8192)])
def test_errors_are_stated_at_the_shots_of_the_run(shots: int | None, stated: int) -> None:
    """A qubit without errors has those of shots alone: the root of 2/3 over their number."""
    qubits = (Qubit(t1_us=1e12, t2_us=1e12, p10=0.0, p01=0.0),) * 4
    device = Device(name="d", source="test", basis_gates=("rz", "sx", "x"), qubits=qubits)
    policy = qcompile.load_policy("cartpole")
    (block,) = placement_section([Compiled(policy, device, shots=shots)]).blocks
    assert isinstance(block, Qubits)
    error = f"{math.sqrt(2 / 3 / stated):.4f}"
    assert {(tile.error, tile.share < 0.001) for tile in block.tiles} == {(error, True)}
    assert f"at {stated} shots, readout mitigated; {error} if perfect." in block.note


def test_qubits_are_best_only_where_others_are_worse() -> None:
    """Those of ibm_lima have the paper's one set of errors, those of fake_lima have their own."""
    policy = qcompile.load_policy("cartpole")
    notes = {}
    for name in ("ibm_lima", "fake_lima"):
        *_, block = placement_section([Compiled(policy, load_device(name), shots=64)]).blocks
        assert isinstance(block, Qubits)
        notes[name] = block.note
    assert "best" not in notes["ibm_lima"]
    assert "on the best qubits, ranked at 1024 shots." in notes["fake_lima"]


def test_the_ideal_device_has_no_placement() -> None:
    policy = qcompile.load_policy("cartpole")
    assert placement_section([Compiled(policy, load_device("ideal"))]).blocks == []


def test_a_twin_stands_beside_its_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with its own qubits, and the reasons that `qcompile show` gives."""
    monkeypatch.chdir(tmp_path)
    policy = hostile_policy()
    calibration = qcompile.calibrate("fake_lima", [3, 4], shots=1000, seed=1, progress=False)
    twin = qcompile.load_backend(calibration)
    compiled = [
        Compiled(policy, load_device("fake_lima")),
        Compiled(policy, twin.device, calibration=calibration, backend="tw.json"),
    ]
    for order in (compiled, compiled[::-1]):
        blocks = placement_section(order).blocks
        found = {block.label: block for block in blocks if isinstance(block, Qubits)}
        assert set(found) == {"Qubits of fake_lima", "Qubits of tw.json"}
        assert {t.qubit for t in found["Qubits of tw.json"].tiles if t.circuits} == {3, 4}
        reasons = {t.qubit: t.why for t in found["Qubits of tw.json"].tiles if t.why}
        values = executable_values(compiled[1].executable(), calibration=calibration)  # type: ignore[arg-type]
        assert reasons == {row["qubit"]: row["reason"] for row in values["left_out"]}
        assert set(reasons.values()) == {"was not calibrated"}
        assert not any(tile.why for tile in found["Qubits of fake_lima"].tiles)
