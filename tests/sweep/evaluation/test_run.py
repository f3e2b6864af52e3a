"""`evaluate` from Python: names, files and objects; greedy cells; what is refused."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from qcompile.calibration import load_calibration
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.device import load_device
from qcompile.errors import CalibrationError, PolicyError, StudyError
from qcompile.execution import OfflineExecutor, load_backend
from qcompile.mitigation import calibrate
from qcompile.policy import Policy
from qcompile.policy.files import save_policy
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation import evaluate, evaluate_paper
from qcompile.sweep.evaluation.cell import CellResult, folder_of, run_cell
from qcompile.sweep.evaluation.grid import Cell
from qcompile.sweep.evaluation.paper import TASKS

MakeCell = Callable[..., Cell]


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def few(*positional: Any, **options: Any) -> Any:
    """Two episodes of 16 shots without mitigation, in this process."""
    defaults = {"shots": 16, "mitigations": "none", "episodes": 2, "workers": 1}
    return evaluate(*positional, **defaults | options)


def figures(summaries: Any) -> list[dict[str, Any]]:
    return [{k: v for k, v in values.items() if k != "wall_seconds"} for values in summaries]


def test_names_files_and_objects_are_the_same(policy: Policy) -> None:
    save_policy(policy, Path("tiny.json"))
    progress: list[Any] = []
    first = few("tiny.json", "ibm_lima", out="a", on_progress=lambda *words: progress.append(words))
    second = few([policy], [load_device("ibm_lima")], shots=[16], levels=[2], out=Path("b"))
    third = few([Path("tiny.json"), policy], load_backend("ibm_lima"), out="a")
    assert figures(first.summaries) == figures(second.summaries)
    assert third.to_dict() == first.to_dict() == json.loads(Path("a/results.json").read_text())
    assert (first.played, first.there, third.played, third.there) == (2, 0, 0, 2)
    assert first.paths == tuple(Path("a", n) for n in ("results.json", "results.csv", "tiny.png"))
    assert [words[:2] for words in progress] == [(0, 2), (1, 2), (2, 2)]
    assert progress[1][2].startswith("tiny on ideal: ")
    first.check_complete()


def test_exact_is_a_number_of_shots_too(policy: Policy) -> None:
    assert [o["shots"] for o in few(policy, "ideal", shots=["exact", None], out="a").summaries] == [
        "exact"
    ]


def test_a_calibration_mitigates_as_an_object_and_as_a_file(policy: Policy) -> None:
    calibration = calibrate(OfflineExecutor(load_device("ibm_lima"), 1), range(5), 64)
    calibration.save(Path("lima.json"))
    options: dict[str, Any] = {"mitigations": "readout", "out": "a"}
    given = few(policy, calibrations=load_calibration(Path("lima.json")), **options)
    named = few(policy, calibrations=["lima.json"], **options)
    assert (given.played, named.played) == (2, 0), "a cell is that of its contents"
    assert [result.summaries[1]["calibration"] for result in (given, named)] == [
        "the calibration of ibm_lima",
        "lima.json",
    ]


def test_notes_are_told(policy: Policy) -> None:
    notes: list[str] = []
    few(policy, "ideal", mitigations=["none", "readout"], on_note=notes.append)
    assert notes == ["Left out: mitigation readout on ideal: it has no errors to mitigate."]


def test_a_greedy_cell_is_a_greedy_run(cell: MakeCell, tmp_path: Path) -> None:
    greedy, sampled = cell(greedy=True, shots=None), cell(shots=None)
    assert greedy.name == "tiny-ibm_lima-exact-none-level2-greedy-episodes3-seed5"
    assert sampled.name == "tiny-ibm_lima-exact-none-level2-episodes3-seed5"
    assert greedy.settings() == sampled.settings() | {"greedy": True}
    result = run_cell(greedy)
    assert isinstance(result, CellResult)
    deployment = Deployment(
        greedy.policy, "ibm_lima", shots=None, mitigation="none", greedy=True, seed=5
    )
    run = play(deployment, 3).summary()
    assert figures([result.summary]) == figures([run])
    folder = folder_of(tmp_path)
    folder.write(greedy, result)
    assert folder.read(greedy) is not None
    folder.file(greedy).rename(folder.file(sampled))
    assert folder.read(sampled) is None


def test_a_greedy_grid_stands_beside_the_sampled_one(policy: Policy) -> None:
    assert few(policy, "ibm_lima").played == 2
    result = few(policy, "ibm_lima", greedy=True)
    assert result.played == 2
    assert [values["greedy"] for values in result.summaries] == [True, True]
    assert few(policy, "ibm_lima").there == 2


def test_the_engine_is_the_callers(policy: Policy, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[dict[str, Any]] = []

    def run_all(cells: Any, run: Any, on_result: Any, **how: Any) -> None:
        calls.append(how)
        for cell in cells:
            on_result(cell, CellFailure(cell.name, "It is too late.\n  Go home."))

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)
    how: dict[str, Any] = {"engine": "ray", "address": "here:1", "workers": 3}
    result = few(policy, "ibm_lima", **how, on_loss=print)
    paper = evaluate_paper(episodes=1, **how, on_loss=print)
    assert [{k: v for k, v in call.items() if k != "noun"} for call in calls] == [
        how | {"on_loss": print}
    ] * 2
    assert (result.to_dict(), len(result.failures), len(paper.failures)) == ({"results": []}, 2, 17)
    with pytest.raises(StudyError) as raised:
        result.check_complete()
    assert str(raised.value).splitlines()[:3] == [
        "2 of 2 cells could not be played.",
        "  tiny-ideal-exact-none-level2-episodes2-seed0: It is too late.",
        "    Go home.",
    ]
    assert not Path("evaluation/devices.md").exists()


def test_what_is_not_there_is_refused(policy: Policy) -> None:
    with pytest.raises(CalibrationError, match=r"^Unknown mitigation 'magic'\.\n  Known: none, "):
        few(policy, mitigations="magic")
    with pytest.raises(PolicyError, match=r"^Unknown policy 'cartpol'\."):
        few(["cartpol"])


def test_the_papers_tasks_are_those_of_version_0_1_0() -> None:
    text = json.dumps([asdict(task) for task in TASKS], sort_keys=True)
    digest = "784ae92c2ba58aa3da438871f449acd6f5f4d21ad1e92092387c2f44964c2ead"
    assert hashlib.sha256(text.encode()).hexdigest() == digest
