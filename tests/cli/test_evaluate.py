"""`qcompile evaluate`: a tiny grid, one that resumes, and what is refused before any episode."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.errors import CalibrationError
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation.cell import run_cell

Call = Callable[..., Any]

FEW = ("--backend", "ibm_lima", "--episodes", 2, "--workers", 1, "--out", "e")
TINY = "tiny-ibm_lima-16-{}-level2-episodes2-seed0.json"


@pytest.fixture
def unplayed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is played."""

    def run_all(*_: Any, **__: Any) -> None:
        pytest.fail("played before everything was checked")

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)


def without_time(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != "wall_seconds"}


def test_help_names_the_grid(qcompile: Call) -> None:
    answer = qcompile("evaluate", "--help")
    assert (answer.code, answer.err) == (0, "")
    for word in ("--mitigation", "--paper", "results.json", "Ctrl-C", "ibm_lima", "1024, 8192"):
        assert word in answer.out


def test_a_tiny_grid(qcompile: Call, policy: Call, left: Call) -> None:
    answer = qcompile("evaluate", policy(), *FEW, "--shots", "16,exact", "--shots", 16)
    assert (answer.code, answer.err) == (0, "")
    assert "tiny in CartPole-v1, 2 episodes, level 2" in answer.out
    assert answer.out.endswith(
        "5 cells played, 0 loaded; written: e/results.json, e/results.csv, e/tiny.png\n"
    )
    objects = json.loads(Path("e/results.json").read_text())["results"]
    assert [(o["backend"], o["shots"], o["mitigation"], o["reference"]) for o in objects] == [
        ("ideal", "exact", "none", True),
        ("ibm_lima", 16, "none", False),
        ("ibm_lima", 16, "readout", False),
        ("ibm_lima", "exact", "none", False),
        ("ibm_lima", "exact", "readout", False),
    ]
    assert len(list(csv.DictReader(Path("e/results.csv").read_text().splitlines()))) == 5
    assert sum(name.startswith("e/cells/") for name in left()) == 5


def test_a_cell_is_what_run_plays(qcompile: Call, policy: Call) -> None:
    name = policy()
    settings = ("--shots", 16, "--mitigation", "readout", "--level", 0, "--seed", 3)
    document = qcompile("evaluate", name, *FEW, *settings, "--json").json()
    assert list(document) == ["results"]
    assert document == json.loads(Path("e/results.json").read_text())
    reference, cell = document["results"]
    run = qcompile("run", name, "--backend", "ibm_lima", "--episodes", 2, *settings, "--json")
    new = ["device", "reference", "ideal_mean_reward", "paired_difference", "paired_std"]
    new += ["paired_ci95", "ratio_to_ideal", "threshold"]
    assert [*cell][len(run.json()) :] == new
    assert without_time(run.json()).items() <= cell.items()
    ideal = qcompile("run", name, "--shots", "exact", "--episodes", 2, "--seed", 3, "--json")
    assert without_time(ideal.json()).items() <= reference.items()
    assert cell["paired_difference"] == cell["mean_reward"] - ideal.json()["mean_reward"]


def test_greedy_cells_are_what_run_plays_greedily(qcompile: Call, policy: Call) -> None:
    name = policy()
    settings = ("--shots", 16, "--mitigation", "none", "--greedy", "--json")
    _, cell = qcompile("evaluate", name, *FEW, *settings).json()["results"]
    table = qcompile("evaluate", name, *FEW, *settings[:-1]).out
    assert "tiny in CartPole-v1, 2 episodes, level 2, greedy" in table
    assert "0 cells played, 2 loaded" in table
    run = qcompile("run", name, "--backend", "ibm_lima", "--episodes", 2, *settings)
    assert cell["greedy"] is True
    assert without_time(run.json()).items() <= cell.items()


def test_a_cluster_that_is_not_there(qcompile: Call, policy: Call) -> None:
    answer = qcompile("evaluate", policy(), *FEW, "--address", "tcp://127.0.0.1:1")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: The engine 'processes' takes no address, found 'tcp://")


def test_what_is_there_is_not_played_again(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("evaluate", policy(), *FEW, "--shots", 16)
    first = qcompile(*words, "--json")
    with monkeypatch.context() as changed:
        changed.setattr("qcompile.sweep.evaluation.run.run_cell", pytest.fail)
        assert qcompile(*words, "--json").out == first.out
    Path("e/cells", TINY.format("none")).write_text("{")
    answer = qcompile(*words)
    assert "1 cell played, 2 loaded" in answer.out
    again = json.loads(Path("e/results.json").read_text())["results"]
    assert [*map(without_time, again)] == [*map(without_time, first.json()["results"])]
    policy(bias=[0.5, 0.0])
    assert "3 cells played, 0 loaded" in qcompile(*words).out
    smaller = qcompile(*words, "--mitigation", "none")
    assert "0 cells played, 2 loaded" in smaller.out
    assert Path("e/cells", TINY.format("readout")).exists()
    assert len(json.loads(Path("e/results.json").read_text())["results"]) == 2


def test_an_interrupted_grid_keeps_what_is_finished(
    qcompile: Call, policy: Call, left: Call, ctrl_c: Call
) -> None:
    words = ("evaluate", policy(), *FEW, "--shots", 16)
    ctrl_c(2)
    answer = qcompile(*words, "--json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == (
        "Error: Interrupted: 2 of 3 cells finished.\n"
        "  They are in e; the same command resumes with the others.\n"
    )
    assert [name for name in left() if name.startswith("e/")] == [
        "e/cells",
        "e/cells/" + TINY.format("none"),
        "e/cells/tiny-ideal-exact-none-level2-episodes2-seed0.json",
    ]
    assert "1 cell played, 2 loaded" in qcompile(*words).out


def test_a_cell_that_fails_is_named_and_the_others_are_kept(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(cell: Any) -> Any:
        if cell.mitigation == "readout":
            error = CalibrationError("Qubit 3 cannot be calibrated.", "Leave it out.")
            return CellFailure(cell.name, str(error))
        return run_cell(cell)

    monkeypatch.setattr("qcompile.sweep.evaluation.run.run_cell", run)
    answer = qcompile("evaluate", policy(), *FEW, "--shots", 16, "--json")
    assert answer.code == 1
    assert [values["mitigation"] for values in answer.json()["results"]] == ["none", "none"]
    assert answer.json() == json.loads(Path("e/results.json").read_text())
    assert answer.err == (
        "Error: 1 of 3 cells could not be played.\n"
        "  tiny-ibm_lima-16-readout-level2-episodes2-seed0: Qubit 3 cannot be calibrated.\n"
        "    Leave it out.\n"
    )


def test_the_ideal_is_not_mitigated(qcompile: Call, policy: Call) -> None:
    words = ("evaluate", policy(), "--backend", "ideal", *FEW[2:], "--shots", 16, "--json")
    answer = qcompile(*words)
    assert answer.code == 0
    why = "mitigation readout on ideal: it has no errors to mitigate.\n"
    assert answer.err == f"Left out: {why}"
    assert [o["mitigation"] for o in answer.json()["results"]] == ["none", "none"]
    refused = qcompile(*words, "--mitigation", "readout")
    assert (refused.code, refused.out) == (1, "")
    assert refused.err == (
        f"Error: There is no combination to play.\n  Left out: {why}"
        "  Add a --backend, --shots, --mitigation or --level that fits the others.\n"
    )


def test_the_papers_devices(qcompile: Call, left: Call) -> None:
    words = ("evaluate", "--paper", "--episodes", 1, "--workers", 1, "--out", "d/devices")
    answer = qcompile(*words, "--page", "d/devices.md", "--json")
    assert (answer.code, answer.err) == (0, "")
    assert len(answer.json()["results"]) == 17
    assert "(devices/devices.png)" in Path("d/devices.md").read_text()
    assert [name for name in left() if name.startswith("d/devices/") and "cells" not in name] == [
        "d/devices/devices.png",
        "d/devices/results.csv",
        "d/devices/results.json",
    ]


# What is refused, before any episode.


REFUSED = {
    "backend": (
        ("tiny.json", "--backend", "ibm_lma"),
        "Error: Unknown backend 'ibm_lma'.\n  Did you mean ibm_lima",
    ),
    "policy": (("cartpol",), "Error: Unknown policy 'cartpol'.\n  Did you mean cartpole"),
    "policy that does not fit": (
        ("wrong.json",),
        "Error: Policy 'tiny' has 2 actions; Acrobot-v1 has 3.\n  Correct `environment`, or",
    ),
    "folder": (
        ("tiny.json", "--out", "file/e"),
        "Error: Cannot write file/e/results.json.\n  file is not a folder.\n",
    ),
}


@pytest.mark.usefixtures("unplayed")
@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_done_is_refused(
    qcompile: Call, policy: Call, left: Call, what: str
) -> None:
    Path(policy(environment="Acrobot-v1")).rename("wrong.json")
    policy()
    Path("file").touch()
    words, text = REFUSED[what]
    answer = qcompile("evaluate", *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(text)
    assert left() == ["file", "tiny.json", "wrong.json"]


@pytest.mark.usefixtures("unplayed")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--mitigation", "none,magic"), "'magic' is not one of none, readout"),
        (("--episodes", 0), "0 is not in the range"),
        (("--shots", "1024,many"), "'many' is neither a number nor 'exact'"),
        (("--shots", 0), "0 is not in the range 1 to 10000000"),
        (("--level", "0,3"), "3 is not in the range"),
        (("--workers", 0), "0 is not in the range"),
        (("--shots", "8,,16"), "'8,,16' has an empty value beside a comma"),
        (("--backend", "ideal,"), "'ideal,' has an empty value beside a comma"),
        (("--out", "file"), "'file' is a file"),
        (("--paper", "--shots", 8), "--paper cannot be combined with policies"),
        (("--paper", "--greedy"), "--paper cannot be combined with policies"),
        (("--engine", "slurm"), "'slurm' is not one of 'processes', 'dask', 'ray'"),
        (("--paper", "--calibration", "lima.json"), "--paper cannot be combined with policies"),
        (("--calibration", "."), "'.' is a directory"),
        (("--paper", "--page", "devices.txt"), "devices.txt must end with .md"),
        (("--page", "devices.md"), "--page needs --paper"),
    ],
)
def test_wrong_usage(qcompile: Call, words: tuple[Any, ...], text: str) -> None:
    Path("file").touch()
    answer = qcompile("evaluate", *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in " ".join(answer.err.split())
