"""Differences to the ideal, by hand; the same results whatever the workers; CSV and pictures."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joblib.externals.loky import get_reusable_executor
from PIL import Image

from qcompile.device import load_device
from qcompile.errors import StudyError
from qcompile.execution import DeviceBackend, OfflineExecutor, load_backend
from qcompile.execution.backend import TwinBackend
from qcompile.mitigation import calibrate
from qcompile.policy import Policy
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel
from qcompile.sweep.engine import run_all
from qcompile.sweep.evaluation.calibrations import CalibrationFile
from qcompile.sweep.evaluation.cell import CellResult, folder_of, run_cell
from qcompile.sweep.evaluation.grid import Cell, grid
from qcompile.sweep.evaluation.page import write_devices
from qcompile.sweep.evaluation.paper import TASKS, paper_cells
from qcompile.sweep.evaluation.summary import compare, results, results_csv
from qcompile.sweep.evaluation.write_up import write_figures, write_results

DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture(scope="module", autouse=True)
def no_workers_left() -> Iterator[None]:
    """joblib keeps its processes for the next call: end them after the last test."""
    yield
    get_reusable_executor().shutdown(wait=True, kill_workers=True)


def by_hand(cell: Cell, rewards: list[float], **changes: Any) -> CellResult:
    """A result with these rewards."""
    episodes = [
        {"seed": cell.seed + i, "reward": reward, "length": 1} for i, reward in enumerate(rewards)
    ]
    mean = sum(rewards) / len(rewards)
    summary = {
        "policy": cell.policy.name,
        "environment": cell.policy.environment,
        "backend": cell.backend.device.name,
        "kind": "noise-model",
        "shots": "exact" if cell.shots is None else cell.shots,
        "mitigation": cell.mitigation,
        "predistort": False,
        "calibration": None,
        "copies": 1,
        "level": cell.level,
        "greedy": False,
        "seed": cell.seed,
        "episodes": episodes,
        "mean_reward": mean,
        "std_reward": 1.0,
        "ci95": [mean - 2, mean + 1],
        "solved": None,
        "gates_per_circuit": {"sx": 2, "rz": 1},
        "circuits_per_step": 4,
        "rounds_per_step": 1,
        "executions": 0,
        "qpu_seconds_estimate": None,
        "env_steps": len(rewards),
        "wall_seconds": 0.1,
        "interrupted": False,
    }
    return CellResult(
        name=cell.name,
        settings=cell.settings(),
        versions={"numpy": "1.2", "gymnasium": "3.4"},
        threshold=changes.pop("threshold", 195.0),
        summary=summary | changes,
    )


def test_a_difference_is_that_of_partners() -> None:
    """Differences -2, +1, -5: mean -2, variance (0 + 9 + 9) / 3; means 8 and 10."""
    figures = compare({1: 6.0, 2: 11.0, 3: 7.0}, {3: 12.0, 1: 8.0, 2: 10.0}, 0)
    low, high = figures.pop("paired_ci95")
    assert figures == {
        "ideal_mean_reward": 10.0,
        "paired_difference": -2.0,
        "paired_std": pytest.approx(6**0.5),
        "ratio_to_ideal": pytest.approx(0.8),
    }
    # Student's t with two degrees of freedom, by hand: 4.3027 * sqrt(9 / 3) = 7.4524.
    assert low <= -2 - 7.452 < -2 + 7.452 <= high


def test_episodes_without_a_partner_are_left_out() -> None:
    figures = compare({1: 6.0, 2: 99.0}, {1: 8.0, 3: 99.0}, 0)
    assert (figures["paired_difference"], figures["ideal_mean_reward"]) == (-2.0, 8.0)
    assert figures["paired_ci95"] is None  # one difference does not say how they scatter


@pytest.mark.parametrize("ideal", [None, {}, {9: 1.0}])
def test_there_may_be_nothing_to_compare_with(ideal: Any) -> None:
    assert {*compare({1: 6.0}, ideal, 0).values()} == {None}


def test_a_ratio_needs_a_positive_ideal() -> None:
    assert compare({1: -90.0}, {1: -80.0}, 0)["ratio_to_ideal"] is None
    assert compare({1: 4.0}, {1: 0.0}, 0)["ratio_to_ideal"] is None


def test_each_policy_has_its_own_ideal(policy: Policy) -> None:
    other = replace(policy, name="other")
    cells = grid([policy, other], [load_backend("ibm_lima")], [8], ["none"], episodes=2)
    rewards = dict(
        zip([cell.name for cell in cells], ([10, 20], [9, 18], [4, 4], [5, 6]), strict=True)
    )
    played = {cell.name: by_hand(cell, rewards[cell.name]) for cell in cells}
    objects = results(cells, played)
    assert [values["reference"] for values in objects] == [True, False, True, False]
    assert [values["paired_difference"] for values in objects] == [0.0, -1.5, 0.0, 1.5]
    assert [values["ideal_mean_reward"] for values in objects] == [15.0, 15.0, 4.0, 4.0]
    assert [values["ratio_to_ideal"] for values in objects] == [1.0, 0.9, 1.0, 5.5 / 4]
    assert {values["threshold"] for values in objects} == {195.0}
    del played[cells[0].name]
    objects = results(cells, played)
    assert [values["paired_difference"] for values in objects] == [None, 0.0, 1.5]


def test_a_row_for_each_cell(policy: Policy) -> None:
    cells = grid([policy], [load_backend("ibm_lima")], [8], ["none"], episodes=2)
    played = {cell.name: by_hand(cell, [1.0, 2.0]) for cell in cells}
    lines = list(csv.DictReader(StringIO(results_csv(results(cells, played)))))
    assert [(line["backend"], line["shots"], line["reference"]) for line in lines] == [
        ("ideal", "exact", "True"),
        ("ibm_lima", "8", "False"),
    ]
    assert (lines[1]["ci95_low"], lines[1]["ci95_high"], lines[1]["episodes"]) == (
        "-0.5",
        "2.5",
        "2",
    )
    assert (lines[1]["paired_ci95_low"], lines[1]["solved"]) == ("0.0", "")


@pytest.mark.parametrize("workers", [1, 2])
def test_results_do_not_depend_on_the_workers(policy: Policy, workers: int) -> None:
    """Noise models, a twin, a sampler; a calibration that is given and one that is measured."""
    lima, belem = load_device("ibm_lima"), load_device("ibm_belem")
    measured = calibrate(OfflineExecutor(lima, 1), np.arange(5), 64)
    backends = [
        DeviceBackend(lima),
        DeviceBackend(belem),
        TwinBackend("lima.json", measured),
        load_backend("qiskit:FakeLimaV2"),
    ]
    files = [CalibrationFile("lima.json", measured)]
    cells = grid([policy], backends, [8], ["readout"], calibrations=files, episodes=2)
    assert len(cells) == 5
    played: dict[str, Any] = {}

    def keep(cell: Cell, result: Any) -> None:
        played[cell.name] = result.summary | {"wall_seconds": 0}

    run_all(cells, run_cell, keep, workers=workers, on_loss=pytest.fail)
    expected = [run_cell(cell) for cell in cells]
    assert played == {r.name: r.summary | {"wall_seconds": 0} for r in expected}  # type: ignore[union-attr]


# Pictures and pages.


def test_a_picture_for_each_policy(policy: Policy, tmp_path: Path) -> None:
    names = ("ibm_lagos", "ibm_belem", "ibm_lima", "ibm_jakarta", "ibm_toronto")
    cells = grid(
        [policy, replace(policy, name="a/b")],
        [load_backend(name) for name in names],
        [1024, 8192],
        ["none", "readout"],
        [0, 2],
        episodes=2,
    )
    played = {cell.name: by_hand(cell, [10.0, 20.0]) for cell in cells}
    objects = results(cells, played)
    first, second = write_figures(objects, tmp_path)
    assert first.name == "tiny.png"
    assert second.name.startswith("a-b-")
    with Image.open(first) as picture:
        assert picture.format == "PNG"
        assert picture.width == 2100, "two panels do not fit in one column of 3.4 inches"
    as_json, as_csv = write_results(objects, tmp_path)
    assert json.loads(as_json.read_text()) == {"results": objects}
    assert len(as_csv.read_text().splitlines()) == len(objects) + 1 == 83


@pytest.mark.parametrize("count", [1, 12])
def test_any_number_of_intervals_is_drawn(count: int) -> None:
    intervals = [Interval("x", f"group {i}", f"{i} shots", i, i - 1, i + 1) for i in range(count)]
    drawn = draw_intervals("title", [Panel("", intervals, (1.0, 0.5, 1.5), -100.0)])
    with Image.open(BytesIO(drawn.png)) as picture:
        assert "Software" not in picture.info


def test_the_paper_is_written_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = paper_cells(2, 3)
    assert len(cells) == 2 * (1 + 2 * 2) + 1 + 3 * 2
    assert {(c.policy.environment, c.shots) for c in cells if not c.is_reference} == {
        ("CartPole-v0", 1024),
        ("Acrobot-v1", 1024),
        ("LunarLander-v3", 8192),
    }
    played = {cell.name: by_hand(cell, [90.0, 110.0 - len(cell.mitigation)]) for cell in cells}
    figure, page = write_devices(cells, played, Path("f"), Path("devices.md"))
    text = page.read_text()
    assert figure.exists()
    assert "(f/devices.png)" in text
    assert "numpy 1.2, gymnasium 3.4" in text
    assert "qcompile evaluate --paper --episodes 2 --seed 3 --out f --page devices.md\n" in text
    assert "play 2 episodes on" in text
    assert "| 96.5 ± 1.0 | - |" in text, "two episodes do not say how they scatter"
    # Rewards 90 and 106 without mitigation, 90 and 103 with readout: means 98 and 96.5.
    assert text.count("| `ibm_lagos` | 1024 | readout mitigation | 96.5 ± 1.0 |") == 2
    # Differences 0 and -3; Student's t with one degree of freedom: 12.706 * 1.5 = 19.1.
    assert text.count("| -1.5 (-20.6 to +17.6) |") == 7
    assert "but up to 77.6% of all episodes may have other rewards." in text  # 1 - sqrt(0.05)
    for task in TASKS:
        assert f"{task.on_devices.mean - task.ideal.mean:+.1f} |" in text
    played.popitem()
    with pytest.raises(StudyError, match=r"^1 of 17 cells are missing\."):
        write_devices(cells, played, Path("f"), Path("devices.md"))


def test_the_committed_page_is_what_its_cells_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where this fails, the page says with which command it is written."""
    monkeypatch.chdir(tmp_path)
    cells = paper_cells(100, 0)
    played = folder_of(DOCS / "devices").finished(cells)
    assert len(played) == len(cells), "played with other policies, devices or settings"
    write_results(results(cells, played), Path("docs/devices"))
    write_devices(cells, played, Path("docs/devices"), Path("docs/background/devices.md"))
    for name in ("background/devices.md", "devices/results.json", "devices/results.csv"):
        assert Path("docs", name).read_text() == (DOCS / name).read_text()
    objects = json.loads((DOCS / "devices" / "results.json").read_text())["results"]
    assert {len(values["episodes"]) for values in objects} == {100}
