"""A cell is what `qcompile run` plays; its file is used for this very cell alone."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from scipy import stats

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.deploy.player import Player
from qcompile.deploy.result import Run
from qcompile.errors import CalibrationError, OutputError
from qcompile.execution import DeviceBackend
from qcompile.policy import Policy
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation import cell as module
from qcompile.sweep.evaluation.cell import CellResult, folder_of, run_cell
from qcompile.sweep.evaluation.grid import Cell

MakeCell = Callable[..., Cell]


def played(cell: Cell) -> CellResult:
    result = run_cell(cell)
    assert isinstance(result, CellResult)
    return result


def numbers(result: CellResult) -> dict[str, Any]:
    return {key: value for key, value in result.summary.items() if key != "wall_seconds"}


@pytest.mark.parametrize("mitigation", ["none", "readout"])
def test_a_cell_is_a_run(cell: MakeCell, mitigation: str) -> None:
    plain_cell = cell(mitigation=mitigation, level=1)
    result = played(plain_cell)
    deployment = Deployment(
        plain_cell.policy,
        plain_cell.backend.device,
        shots=16,
        level=1,
        mitigation=mitigation,
        seed=5,
    )
    run = play(deployment, 3).summary()
    assert numbers(result) == {k: v for k, v in run.items() if k != "wall_seconds"}
    assert (result.threshold, result.versions["qcompile"]) == (475.0, "0.1.0")


def test_a_held_policy_is_held_in_a_worker(cell: MakeCell, policy: Policy) -> None:
    """A cell goes to a worker as bytes."""
    held = cell(policy=replace(policy, hold=3))
    summary = played(pickle.loads(pickle.dumps(held))).summary
    assert summary["hold"] == 3
    lengths = [episode["length"] for episode in summary["episodes"]]
    assert summary["decisions"] == sum(-(-length // 3) for length in lengths)
    assert held.settings() != cell().settings()


def test_every_cell_resets_with_the_same_seeds(cell: MakeCell) -> None:
    results = [played(cell(shots=shots)) for shots in (1, None)]
    assert [list(result.rewards) for result in results] == [[5, 6, 7]] * 2
    assert results[0].rewards != results[1].rewards


def test_half_a_cell_is_no_result(cell: MakeCell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        module, "play", lambda deployment, episodes: Run(deployment, interrupted=True)
    )
    with pytest.raises(KeyboardInterrupt):
        run_cell(cell())


def test_what_fails_is_named(cell: MakeCell, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any, **__: Any) -> Player:
        raise CalibrationError("Qubit 3 cannot be calibrated.", "Leave it out.")

    monkeypatch.setattr(module, "player", fails)
    words = "Qubit 3 cannot be calibrated.\n  Leave it out."
    assert run_cell(cell()) == CellFailure(cell().name, words)


# The file of a cell.


@pytest.fixture
def stored(cell: MakeCell, tmp_path: Path) -> tuple[Cell, Path]:
    """A cell, and the file its result is in."""
    plain_cell = cell()
    folder_of(tmp_path).write(plain_cell, played(plain_cell))
    (file,) = (tmp_path / "cells").iterdir()
    return plain_cell, file


def test_a_result_is_read_back(stored: tuple[Cell, Path]) -> None:
    cell, file = stored
    assert file.name == "tiny-ibm_lima-16-none-level2-episodes3-seed5.json"
    result = folder_of(file.parents[1]).read(cell)
    assert result is not None
    assert numbers(result) == numbers(played(cell))


def test_a_result_is_that_of_its_cell_alone(stored: tuple[Cell, Path], policy: Policy) -> None:
    cell, file = stored
    other = DeviceBackend(cell.backend.device.model_copy(update={"source": "elsewhere"}))
    folder = folder_of(file.parents[1])
    assert folder.read(replace(cell, policy=replace(policy, theta=policy.theta + 1))) is None
    assert folder.read(replace(cell, backend=other)) is None
    more = replace(cell, seed=6)
    (file.parent / f"{more.name}.json").write_bytes(file.read_bytes())
    assert folder.read(more) is None
    assert folder.read(replace(cell, shots=17)) is None


def changed(**changes: Any) -> Callable[[str], str]:
    """Damage: these keys of the summary have other values."""

    def change(text: str) -> str:
        values = json.loads(text)
        values["summary"] |= changes
        return json.dumps(values)

    return change


def without(key: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        values = json.loads(text)
        del values["summary"][key]
        return json.dumps(values)

    return change


def without_episode(text: str) -> str:
    values = json.loads(text)
    del values["summary"]["episodes"][1]
    return json.dumps(values)


def other_threshold(text: str) -> str:
    return json.dumps(json.loads(text) | {"threshold": 1.0})


@pytest.mark.parametrize(
    "damage",
    {
        "empty": lambda text: "",
        "cut": lambda text: text[:-20],
        "a list": lambda text: "[]",
        "other format": lambda text: text.replace("qcompile-evaluation-1", "qcompile-evaluation-2"),
        "no mean": lambda text: text.replace('"mean_reward"', '"mean"'),
        "an episode less": without_episode,
        "no time": changed(wall_seconds=float("nan")),
        "a time before": changed(wall_seconds=-1.0),
        "another policy": changed(policy="other"),
        "another backend": changed(backend="ibm_belem"),
        "other shots": changed(shots=17),
        "another kind": changed(kind="guess"),
        "another mean": changed(mean_reward=9.0),
        "another scatter": changed(std_reward=0.125),
        "an interval of three": changed(ci95=[1.0, 2.0, 3.0]),
        "a number as text": changed(executions="12"),
        "solved": changed(solved=True),
        "other steps": changed(env_steps=1),
        "a key less": without("rounds_per_step"),
        "a key more": changed(surprise=1),
        "another threshold": other_threshold,
        "no number": lambda text: text.replace('"mean_reward": ', '"mean_reward": "x", "x": '),
    }.items(),
    ids=lambda item: item[0],
)
def test_a_damaged_file_is_no_result(
    stored: tuple[Cell, Path], damage: tuple[str, Callable[[str], str]]
) -> None:
    cell, file = stored
    damaged = damage[1](file.read_text())
    assert damaged != file.read_text()
    file.write_text(damaged)
    assert folder_of(file.parents[1]).read(cell) is None


@pytest.mark.parametrize("interval", [None, [0.0, 1.0], [9.0, 8.0]])
def test_an_interval_of_an_earlier_version_is_worked_out_anew(
    stored: tuple[Cell, Path], interval: Any
) -> None:
    cell, file = stored
    result = folder_of(file.parents[1]).read(cell)
    assert result is not None
    rewards = [*result.rewards.values()]
    theirs = stats.ttest_1samp(rewards, 0).confidence_interval(0.95)
    low, high = result.summary["ci95"]
    assert low <= theirs.low < theirs.high <= high
    file.write_text(changed(ci95=interval)(file.read_text()))
    assert folder_of(file.parents[1]).read(cell) == result


def test_a_result_that_cannot_be_written(cell: MakeCell, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file is not a folder"):
        folder_of(tmp_path / "file").write(cell(), played(cell()))
