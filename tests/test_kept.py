"""Files that version 0.1.0 wrote, read today: each gives the figures that 0.1.0 printed of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.calibration import load_calibration
from qcompile.live.perform import task_of
from qcompile.live.play import RunTask
from qcompile.live.runs import find_journal
from qcompile.policy import load_policy, save_policy
from qcompile.policy.files import policy_values
from qcompile.report.calibration_values import calibration_values
from qcompile.rl.checkpoint import load_checkpoint

Call = Callable[..., Any]

KEPT = Path(__file__).parent / "kept"

POLICIES = ("policy.json", "policy.pt")


def printed(name: str) -> Any:
    return json.loads((KEPT / "printed" / f"{name}.json").read_text())


def check_same(found: dict[str, Any], expected: dict[str, Any], *but: str) -> None:
    """All that 0.1.0 printed is still there and the same, `but` for a few keys."""
    for key in expected.keys() - set(but):
        assert without_new(found[key], expected[key]) == expected[key], key


def without_new(found: Any, expected: Any) -> Any:
    """`found` without the keys of its dicts that `expected` does not have."""
    if isinstance(found, dict) and isinstance(expected, dict):
        return {key: without_new(found[key], expected[key]) for key in found.keys() & expected}
    if isinstance(found, list) and isinstance(expected, list) and len(found) == len(expected):
        return [without_new(*pair) for pair in zip(found, expected, strict=True)]
    return found


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_plays_as_it_did(name: str, qcompile: Call) -> None:
    """Its interval is another one since: 0.1.0 had a plain bootstrap."""
    words = ("--greedy", "--shots", "exact", "--episodes", 4, "--max-steps", 120, "--json")
    found = qcompile("run", KEPT / name, *words).json()
    check_same(found, printed("run"), "wall_seconds", "ci95")


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_compiles_as_it_did(name: str, qcompile: Call) -> None:
    found = qcompile("show", KEPT / name, "--backend", "ibm_lima", "--json").json()
    check_same(found, printed("show"))


def test_a_policy_is_written_as_it_was(tmp_path: Path) -> None:
    save_policy(load_policy(KEPT / "policy.json"), tmp_path / "p.json")
    assert (tmp_path / "p.json").read_bytes() == (KEPT / "policy.json").read_bytes()


def test_a_device_has_its_numbers(qcompile: Call) -> None:
    found = qcompile("backends", "show", KEPT / "device.json", "--json").json()
    check_same(found, printed("backends-show"))


def test_a_calibration_has_its_fits() -> None:
    found = calibration_values(load_calibration(KEPT / "calibration.json"))
    expected = printed("calibrate")
    assert found["qubits"]
    for row, old in zip(found["qubits"], expected.pop("qubits"), strict=True):
        assert row == pytest.approx(old, rel=1e-9)
    check_same(found, expected, "file")


@pytest.fixture
def runs(tmp_path: Path) -> Callable[[str], Path]:
    """A folder with a kept journal, which may be brought up to date there."""

    def make(state: str) -> Path:
        folder = tmp_path / "runs" / printed(f"runs-show-{state}")["run"]
        folder.mkdir(parents=True)
        shutil.copy(KEPT / f"run-{state}.sqlite", folder / "journal.sqlite")
        return folder.parent

    return make


def test_a_finished_journal_has_its_result(runs: Call, qcompile: Call) -> None:
    found = qcompile("runs", "--runs", runs("finished"), "show", "last", "--json").json()
    expected = printed("runs-show-finished")
    check_same(found["result"], expected.pop("result"))
    check_same(found, expected)


def check_open_job(found: dict[str, Any], expected: dict[str, Any]) -> None:
    """What 0.1.0 called `qpu_seconds` is settled; today it has the cap of the open job as well."""
    settled_s = expected.pop("qpu_seconds")
    assert (found["qpu_seconds_settled"], found["qpu_seconds"]) == (settled_s, settled_s + 19)
    check_same(found, expected)


def test_an_unfinished_journal_says_where_it_stands(runs: Call, qcompile: Call) -> None:
    found = qcompile("runs", "--runs", runs("unfinished"), "show", "last", "--json").json()
    check_open_job(found, printed("runs-show-unfinished"))


def test_an_unfinished_journal_has_its_steps_and_jobs(
    runs: Call, qcompile: Call, tmp_path: Path
) -> None:
    out = tmp_path / "run.json"
    answer = qcompile("runs", "--runs", runs("unfinished"), "export", "last", "--out", out)
    assert answer.code == 0, answer.err
    found, expected = json.loads(out.read_text()), printed("runs-export-unfinished")
    for job, old in zip(found["jobs"], expected.pop("jobs"), strict=True):
        check_same(job, old)
    check_open_job(found, expected)


@pytest.mark.parametrize("state", ["finished", "unfinished"])
def test_a_journal_has_its_task(state: str, runs: Call) -> None:
    with find_journal(runs(state), "last") as journal:
        task = task_of(journal)
    assert isinstance(task, RunTask)
    kept = load_policy(KEPT / "policy.json")
    assert policy_values(task.policy.policy()) == policy_values(kept)
    assert (task.shots, task.episodes, task.max_steps, task.seed) == (64, 2, 3, 4)


def test_a_cell_of_evaluate_is_not_played_again(tmp_path: Path, qcompile: Call) -> None:
    """Played again it would take another time; the reference is not kept, and is played."""
    out = shutil.copytree(KEPT / "evaluation", tmp_path / "evaluation")
    words = ("--shots", 64, "--mitigation", "readout", "--episodes", 3, "--seed", 2, "--json")
    files = (KEPT / "policy.json", "--backend", KEPT / "device.json", "--out", out)
    _, found = qcompile("evaluate", *files, *words, "--workers", 1).json()["results"]
    _, expected = printed("evaluate")["results"]
    own = ("ci95", "ideal_mean_reward", "paired_difference", "paired_std", "paired_ci95")
    check_same(found, expected, *own, "ratio_to_ideal")


def test_a_cell_of_the_study_is_not_trained_again(tmp_path: Path, qcompile: Call) -> None:
    """0.1.0 had averages of 20 episodes even where there are but five."""
    out = shutil.copytree(KEPT / "study", tmp_path / "study")
    words = ("--row", "cartpole-fcn-small-paper", "--seeds", 1, "--episodes", 5)
    options = ("--evaluation", 5, "--workers", 1, "--out", out, "--json")
    found = qcompile("study", *words, *options).json()
    assert found["trained"] == 0
    own = ("best_average", "last_average")
    check_same(found["rows"][0], printed("study")["rows"][0], *own)


def test_a_checkpoint_of_an_entangling_circuit_becomes_a_policy(
    tmp_path: Path, qcompile: Call
) -> None:
    """The outputs and rewards are those that 0.1.0 computed with its own code for this circuit."""
    state = shutil.copy(KEPT / "mvqc-checkpoint.pt", tmp_path)
    trainer, _ = load_checkpoint(Path(state))
    observations = torch.tensor([[0.1, -0.5, 0.02, 0.7], [1.0, 2.0, -0.1, -1.5]])
    expected = [[-0.0379544906, 0.2647983432], [-0.1154583991, 0.3198476732]]
    found = trainer.actor(observations).detach().numpy()
    np.testing.assert_allclose(found, expected, atol=2e-6)
    rewards = [28.0, 16.0, 37.0, 13.0, 24.0, 35.0, 24.0, 25.0, 35.0, 29.0, 18.0, 50.0]
    assert [episode.reward for episode in trainer.history] == rewards
    out = tmp_path / "policy.json"
    assert qcompile("train", "CartPole-v1", "--resume", state, "--out", out).code == 0
    assert qcompile("run", out, "--episodes", 2, "--max-steps", 5).code == 0


def test_a_checkpoint_is_where_its_training_was() -> None:
    trainer, _ = load_checkpoint(KEPT / "checkpoint.pt")
    expected, policy = printed("train"), load_policy(KEPT / "policy.pt")
    assert [trainer.environment, trainer.seed] == [expected["environment"], expected["seed"]]
    assert [len(trainer.history), trainer.steps] == [expected["episodes"], expected["steps"]]
    rewards = [episode.reward for episode in trainer.history]
    assert np.mean(rewards) == expected["last_20_mean_reward"]
    found = trainer.policy()
    assert found.parameter_count == expected["parameters"]
    for name in ("theta", "weights", "bias"):
        np.testing.assert_array_equal(getattr(found, name), getattr(policy, name))
