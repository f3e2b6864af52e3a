"""`qcompile show` on a device: which circuit has which qubit, and why."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.device import load_device
from qcompile.noise import mean_square_error

Call = Callable[..., Any]


def placement(out: str) -> list[str]:
    """The lines from the title of the placement on."""
    lines = [line.strip() for line in out.splitlines() if line.strip()]
    return lines[next(i for i, line in enumerate(lines) if line.startswith("Placement")) :]


def column(out: str, name: str) -> list[str]:
    """The lines of the table of circuits from column `name` to the next, by their positions."""
    lines = [line.rstrip() for line in out.splitlines()]
    head = next(i for i, line in enumerate(lines) if line.split()[:1] == ["circuit"])
    start, end = lines[head].index(name), lines[head].index("before")
    rows = lines[head + 2 : lines.index("", head)]
    return [row[start:end].strip() for row in rows]


@pytest.mark.parametrize(
    ("encoder", "reads", "words"),
    [
        (
            {"function": "arctan", "feature": [3, 0, 1, 2], "scale": [1.7512, 1.0, -2.0, 0.5]},
            ["1.75*obs[3]", "obs[0]", "-2*obs[1]", "0.5*obs[2]"],
            "a feature of the observation (obs) times its scale; x is its arctan",
        ),
        (
            {
                "function": "tanh",
                "feature": [0, 0, 1, 1],
                "scale": [1.0, 2.0, 1.0, 1.0],
                "gain": [1.0, 1.0, 0.25, 1.0],
                "mean": [0.5, -0.5],
                "std": [4.0, 8.0],
            },
            ["(obs[0]-0.5)/4", "2*(obs[0]-0.5)/4", "(obs[1]+0.5)/8, gain 0.25", "(obs[1]+0.5)/8"],
            "a feature of the observation (obs) times its scale; x is its tanh, times the gain",
        ),
        (
            {"function": "bits", "feature": [0, 1, 2, 3], "scale": [1.0] * 4},
            ["bit 0", "bit 1", "bit 2", "bit 3"],
            "a bit of the observation, a number; x is pi times the bit",
        ),
    ],
    ids=["scales", "statistics", "bits"],
)
def test_what_every_circuit_reads(
    qcompile: Call,
    policy: Call,
    monkeypatch: pytest.MonkeyPatch,
    encoder: dict[str, Any],
    reads: list[str],
    words: str,
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    name = policy(format="qcompile-policy-2", encoder=encoder)
    answer = qcompile("show", name)
    assert (answer.code, answer.err) == (0, "")
    assert column(answer.out, "reads") == reads
    assert f"reads: {words}\n" in answer.out
    (first, *_) = json.loads(qcompile("show", name, "--json").out)["circuits"]
    numbers = {key: encoder[key][0] for key in ("scale", "gain", "mean", "std") if key in encoder}
    expected = {"input": "x0", "feature": encoder["feature"][0], "function": encoder["function"]}
    assert first["reads"] == [{**expected, **numbers}]


def test_inputs_of_one_circuit_have_a_line_each(qcompile: Call, policy: Call) -> None:
    circuit = [["ry", f"x{i}"] for i in (1, 0)]
    answer = qcompile("show", policy(circuits=[circuit], theta=[], weights=[[1.0], [0.0]]))
    assert column(answer.out, "reads") == ["x0: obs[0]", "x1: obs[1]"]


def test_the_placement_of_a_small_policy(qcompile: Call, policy: Call) -> None:
    """Weights 1, 1, 2, 1 and their opposites: importance 1, 1, 4, 1, of 7."""
    answer = qcompile("show", policy(), "--backend", "fake_lagos")
    assert (answer.code, answer.err) == (0, "")
    assert placement(answer.out) == [
        "Placement on fake_lagos, in 2 rounds",
        "circuit   importance   qubit   round   error of <Z>",
        "─" * 53,
        "2    57.1 %          3       0   0.0269",
        "0    14.3 %          3       1   0.0269",
        "1    14.3 %          4       0   0.0279",
        "3    14.3 %          4       1   0.0279",
        "importance: variance of a circuit's weights over actions, as a share of all",
        "error of <Z>: root mean square at 1024 shots, readout mitigated (0.0255 if",
        "perfect)",
        "unused qubits (at least 0.8 of <Z> must be left): 0 keeps 0.66 of <Z>, 1 keeps",
        "0.73 of <Z>, 2 keeps 0.07 of <Z>, 5 keeps 0.48 of <Z>, 6 keeps 0.30 of <Z>",
        "the device is too small for all circuits at once: they are run in 2 rounds",
    ]


def test_the_rest_of_a_large_device_is_for_other_episodes(qcompile: Call, policy: Call) -> None:
    lines = placement(qcompile("show", policy(), "--backend", "fake_toronto").out)
    assert lines[0] == "Placement on fake_toronto, in 1 round"
    assert lines[-1] == "6 copies of the circuits fit on the device at once (--copies)"


def test_twenty_four_circuits_stay_readable(qcompile: Call) -> None:
    """A line for each circuit, before and after, and one for its place, within 80 columns."""
    answer = qcompile("show", "lunarlander", "--backend", "fake_lagos")
    lines = answer.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) < 75
    assert len(placement(answer.out)) == 3 + 24 + 6


def test_json_says_the_same(qcompile: Call, policy: Call) -> None:
    found = qcompile("show", policy(), "--backend", "fake_lagos", "--json").json()
    lagos = load_device("fake_lagos")
    assert found["copies_that_fit"] == 1
    assert [row["qubit"] for row in found["left_out"]] == [0, 1, 2, 5, 6]
    assert found["left_out"][0]["reason"] == "keeps 0.66 of <Z>"
    assert [c["importance"] for c in found["circuits"]] == pytest.approx(
        [1 / 7, 1 / 7, 4 / 7, 1 / 7]
    )
    assert [(c["qubit"], c["round"]) for c in found["circuits"]] == [(3, 1), (4, 0), (3, 0), (4, 1)]
    for circuit in found["circuits"]:
        expected = mean_square_error(lagos, circuit["qubit"])
        assert circuit["expected_error"] ** 2 == pytest.approx(expected, rel=1e-12)


def test_run_export_and_show_agree(qcompile: Call, policy: Call) -> None:
    written = policy(weights=[[0.0, 1.0, 3.0, 2.0], [0.0] * 4])
    words = (written, "--backend", "fake_lagos", "--json")
    shown = qcompile("show", *words).json()["circuits"]
    job = qcompile("export", *words, "--out", "job").json()
    placed = {
        (circuit, qubit, index)
        for index, program in enumerate(job["programs"])
        for circuit, qubit in zip(program["circuits"], program["qubits"], strict=True)
    }
    assert placed == {(c["circuit"], c["qubit"], c["round"]) for c in shown}
    assert [c["qubit"] for c in shown] == [4, 4, 3, 3]


def test_ideal_needs_no_placement(qcompile: Call, policy: Call) -> None:
    answer = qcompile("show", policy())
    assert "Placement" not in answer.out
    found = qcompile("show", policy(), "--json").json()
    assert (found["copies_that_fit"], found["left_out"]) == (1, [])
    assert [c["expected_error"] for c in found["circuits"]] == [None] * 4


def test_a_program_file_has_no_importance(qcompile: Call) -> None:
    Path("in.qasm").write_text("OPENQASM 3.0;\nqubit[2] q;\nbit[2] c;\nc = measure q;\n")
    lines = placement(qcompile("show", "in.qasm", "--backend", "fake_lima").out)
    assert lines[1] == "circuit   qubit   round   error of <Z>"
    assert not any("importance" in line for line in lines)


def test_qubits_left_out_by_the_file_are_named(qcompile: Call, policy: Call) -> None:
    values = json.loads(load_device("fake_lima").to_json()) | {"name": "mine", "left_out": [2, 3]}
    Path("mine.json").write_text(json.dumps(values))
    lines = placement(qcompile("show", policy(), "--backend", "mine.json").out)
    assert " ".join(lines[-3:-1]).endswith(": 2 is in left_out, 3 is in left_out")
