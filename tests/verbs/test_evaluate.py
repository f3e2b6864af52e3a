"""`qcompile.evaluate`, `plan`, `study` and `validate` in Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import qcompile
from qcompile.calibration import load_calibration
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.deploy.result import Run
from qcompile.errors import DeviceError, OptionError, StudyError
from qcompile.execution import OfflineExecutor


def test_a_grid_of_names_and_objects_leaves_no_file() -> None:
    trained = qcompile.train("CartPole-v1", preset="paper", episodes=1).policy
    assert isinstance(trained, qcompile.Policy)
    policy = replace(trained, name="cartpole")
    backends = ["ideal", qcompile.load_device("fake_lima")]
    options: dict[str, Any] = {"shots": [8, "exact"], "mitigations": "none", "workers": 1}
    grid = qcompile.evaluate(["cartpole", policy], backends, episodes=2, **options)
    grid.check_complete()
    played = [(cell["policy"], cell["backend"], cell["shots"]) for cell in grid.cells]
    assert played == [
        (name, backend, shots)
        for name in ("cartpole", "cartpole (2)")
        for backend, shots in [
            *(("ideal", "exact"), ("ideal", 8)),
            *(("fake_lima", 8), ("fake_lima", "exact")),
        ]
    ]
    assert (grid.played, grid.there, grid.paths) == (8, 0, [])
    assert len(repr(grid).splitlines()) == 1 + 8
    assert grid.plot("cartpole").png != grid.plot().png
    with pytest.raises(StudyError, match="There is no policy 'x' in the grid"):
        grid.plot("x")
    assert list(Path().iterdir()) == []


def _failing_on_lima(deployment: Deployment, episodes: int) -> Run:
    if deployment.device.name == "fake_lima":
        raise DeviceError("It broke.")
    return play(deployment, episodes)


def test_cells_that_failed_are_told_below_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {"shots": 8, "mitigations": "none", "workers": 1, "episodes": 1}
    monkeypatch.setattr("qcompile.sweep.evaluation.cell.play", _failing_on_lima)
    grid = qcompile.evaluate("cartpole", "fake_lima", **options)
    words = "1 cell could not be played: check_complete() says why"
    assert repr(grid).splitlines()[-1] == words
    assert grid._repr_html_().endswith(f"<p>{words}</p>")


def test_a_folder_is_filled_and_read_again() -> None:
    options: dict[str, Any] = {"shots": 8, "mitigations": "none", "episodes": 1, "workers": 1}
    first = qcompile.evaluate("cartpole", "ibm_lima", out="e", **options)
    again = qcompile.evaluate("cartpole", "ibm_lima", out="e", **options)
    assert (first.played, again.played, again.there) == (2, 0, 2)
    assert again.cells == first.cells
    assert again.paths == [Path("e") / name for name in ("results.json", "results.csv")] + [
        Path("e/cartpole.png")
    ]


def test_ctrl_c_without_a_folder_says_how_to_keep_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    def run_all(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)
    with pytest.raises(StudyError) as error:
        qcompile.evaluate("cartpole", "ibm_lima", shots=8)
    assert str(error.value) == (
        "Interrupted: 0 of 3 cells finished.\n  With out=FOLDER, finished cells are kept."
    )


def test_an_executor_is_no_backend_of_a_grid() -> None:
    executor = OfflineExecutor(qcompile.load_device("ibm_lima"), 0)
    with pytest.raises(DeviceError, match=r"cannot be played on an executor, found .*\(ibm_lima\)"):
        qcompile.evaluate("cartpole", [executor])


def test_a_plan_counts_jobs_and_seconds() -> None:
    """Two steps of four circuits: in the paper's way a job of 100 shots for each of them."""
    plan = qcompile.plan(qcompile.load_policy("cartpole"), "ibm_lima", max_steps=2, shots=100)
    first, *_ = plan.strategies
    assert (first["jobs"], first["executions"]) == (8, 800)
    assert first["qpu_seconds"] == pytest.approx(8 * 2 + 800 * 0.00035)
    assert repr(plan).splitlines()[1].split() == [
        *("as", "in", "the", "paper", "8", "800", "16.3", "26", "3", "%")
    ]
    assert plan.plot().png[:4] == b"\x89PNG"
    with pytest.raises(OptionError, match="account needs live"):
        qcompile.plan("cartpole", account="mine")
    with pytest.raises(OptionError, match="A live plan needs the name of an IBM machine"):
        qcompile.plan("cartpole", qcompile.load_device("ibm_lima"), live=True)


def test_a_validation_says_which_qubits_fail() -> None:
    calibration = qcompile.calibrate("fake_lima", shots=4000, seed=1)
    options: dict[str, Any] = {"policy": "cartpole", "observations": 3, "shots": 1000}
    validation = qcompile.validate(calibration, **options)
    assert validation.passed
    validation.check_passed()
    assert {row[-1] for row in validation.table().words} == {"holds"}
    calibration.save("lima.json")
    assert qcompile.validate("lima.json", **options).to_dict()["file"] == "lima.json"
    with pytest.raises(OptionError, match="backend cannot be combined with live"):
        qcompile.validate(load_calibration("lima.json"), backend="ideal", live=qcompile.Live(9))
    with pytest.raises(OptionError, match="power chooses observations or shots: give at most two"):
        qcompile.validate(calibration, power=0.9, observations=3, shots=9)


def test_a_study_shows_its_rows() -> None:
    study = qcompile.study(
        rows="cartpole-svqc-paper", seeds=1, episodes=2, evaluation=1, out="s", workers=1
    )
    assert (study.trained, study.there, study.page) == (1, 0, Path("s/reproduction.md"))
    assert [row[0] for row in study.table().words] == ["cartpole-svqc-paper"]
    assert study.plot("cartpole").png == Path("s/cartpole.png").read_bytes()
    with pytest.raises(StudyError, match="no trainings of figure 'pong'"):
        study.plot("pong")
