"""`qcompile show` of circuits of several qubits."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rings import ring_policy

from qcompile.device import load_device
from qcompile.ir import Circuit

Call = Callable[..., Any]


@pytest.fixture
def ring() -> str:
    Path("ring.json").write_text(json.dumps(ring_policy()))
    return "ring.json"


def test_rows_have_what_each_circuit_has(ring: str, qcompile: Call) -> None:
    """Counted again from the texts of the circuits, the success from the device's file."""
    found = qcompile("show", ring, "--backend", "fake_lima", "--json").json()
    (row,) = found["circuits"]
    before, after = (Circuit.parse(row[key], 4) for key in ("source", "compiled"))
    assert row["gates_before_by_name"] == {"cz": 4, "rx": 4, "ry": 8, "rz": 8}
    assert row["gates"] == Counter(gate.name for gate in after.gates)
    assert (row["couplings_before"], row["couplings"]) == (4, row["gates"]["cx"])
    assert row["gates_before"] == len(before)
    assert row["depth_before"] == 3 + 4 + 2, "a layer, the ring, and two turns"
    assert row["bits"] == [0, 1, 2, 3]
    assert len(row["qubits"]) == 4
    assert (row["routing_qubits"], row["qubit"], row["expected_error"]) == ([], None, None)
    assert [read["feature"] for read in row["reads"]] == [0, 1, 2, 3]
    assert found["observables"] == [
        {"observable": 0, "bits": [0, 1], "importance": 0.9},
        {"observable": 1, "bits": [2, 3], "importance": pytest.approx(0.1)},
    ]
    lima, success = load_device("fake_lima"), 1.0
    cx = {coupling.qubits: coupling.error for coupling in lima.couplings}
    for gate in after.gates:
        places = tuple(row["qubits"][qubit] for qubit in gate.qubits)
        if gate.name == "cx":
            success *= 1 - cx[places]
        elif gate.name == "sx":
            success *= 1 - lima.qubits[places[0]].gates["sx"].error
    success *= math.prod(1 - (lima.qubits[q].p10 + lima.qubits[q].p01) / 2 for q in row["qubits"])
    assert row["estimated_success"] == pytest.approx(success)


def test_the_circuits_are_drawn_on_the_terminal(ring: str, qcompile: Call) -> None:
    out = qcompile("show", ring, "--backend", "fake_lima").out
    assert "ring for CartPole-v1: 1 circuit on 4 qubits, 2 actions, 26 trained numbers" in out
    assert "circuit 0, bit 0  |0>─ rx(x0) ─ ry(theta0)" in out
    assert "4 cz + 4 rx + 8 ry + 8 rz" in out
    assert "x2: 4*obs[2]" in out
    assert "<Z2 Z3>" in out
    assert "success: the product of 1 - error" in out


def test_a_long_drawing_is_left_to_a_file(qcompile: Call) -> None:
    Path("deep.json").write_text(json.dumps(ring_policy(6)))
    answer = qcompile("show", "deep.json", "--draw", "deep.txt")
    assert "after, for ideal, level 2: a drawing of " in answer.out
    assert "--draw writes it to a file" in answer.out
    drawn = Path("deep.txt").read_text()
    assert drawn.count("●") == 2 * 2 * 4 * 6, "two dots of each cz, before and after"


def test_observables_of_circuits_of_one_qubit_are_named(qcompile: Call) -> None:
    circuits = [[["ry", f"x{i}"]] for i in range(3)]
    values = ring_policy(circuits=circuits, observables=[[2], [0]], theta=[], name="narrow")
    values["encoder"] |= {"feature": [0, 1, 2], "scale": [1.0] * 3}
    Path("narrow.json").write_text(json.dumps(values))
    found = qcompile("show", "narrow.json", "--backend", "fake_lima", "--json").json()
    assert [row["bits"] for row in found["observables"]] == [[2], [0]]
    assert [row["importance"] for row in found["circuits"]] == pytest.approx([0.1, 0.0, 0.9])
    assert "bits" not in found["circuits"][0]
    best = found["circuits"][2]["qubit"]
    errors = [row["expected_error"] for row in found["circuits"]]
    assert errors[2] == min(errors), f"the observable that matters most is on qubit {best}"


@pytest.mark.parametrize("name", ["map.svg", "map.png", "map.pdf"])
def test_a_map_is_written(name: str, ring: str, qcompile: Call) -> None:
    answer = qcompile("show", ring, "--backend", "fake_lima", "--map", name, "--draw", "c.svg")
    assert (answer.code, answer.err) == (0, f"drawing written to c.svg\nmap written to {name}\n")
    assert Path(name).stat().st_size > 1000
    if name == "map.svg":
        assert ">ring on fake_lima<" in Path(name).read_text()


def test_a_map_of_a_policy_of_narrow_circuits(policy: Callable[..., str], qcompile: Call) -> None:
    answer = qcompile("show", policy(), "--backend", "fake_lima", "--map", "m.svg", "--json")
    assert (answer.code, answer.err) == (0, "map written to m.svg\n")
    assert answer.json()["backend"] == "fake_lima"


def test_a_map_has_a_style(ring: str, qcompile: Call) -> None:
    Path("mine.mplstyle").write_text("font.family: monospace\n")
    words = ("show", ring, "--backend", "fake_lima", "--map", "m.svg", "--style", "mine.mplstyle")
    assert qcompile(*words).code == 0
    assert "monospace" in Path("m.svg").read_text()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--map", "a.jpg"), 2, "a.jpg must end with .png, .svg or .pdf."),
        (("--map", "a.svg"), 1, "There is no map of ideal"),
        (("--map", "a.svg", "--backend", "ibm_lima"), 1, "ibm_lima"),
        (("--map", "a.svg", "--draw", "a.svg"), 2, "a.svg"),
        (("--style", "a.mplstyle"), 2, "--style needs --map."),
        (("--surrogate", "--map", "a.svg"), 2, "--surrogate and --map"),
    ],
)
def test_maps_that_cannot_be_drawn(
    words: tuple[str, ...], code: int, said: str, policy: Callable[..., str], qcompile: Call
) -> None:
    answer = qcompile("show", policy(), *words)
    assert (answer.code, answer.out) == (code, "")
    assert said in answer.err
    assert not Path("a.svg").exists()
