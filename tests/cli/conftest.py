"""An empty folder to call the command line in, and a tiny policy."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every test works in an empty folder, so that messages show short paths."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def tiny(**changes: Any) -> dict[str, Any]:
    """The values of a CartPole policy with one circuit for each feature."""
    values = {
        "format": "qcompile-policy-1",
        "name": "tiny",
        "environment": "CartPole-v1",
        "encoder": {"function": "arctan", "feature": [0, 1, 2, 3], "scale": [1.0] * 4},
        "circuits": [[["h"], ["ry", f"x{i}"], ["rz", f"x{i}"], ["ry", "theta0"]] for i in range(4)],
        "theta": [0.1],
        "weights": [[1.0, 1.0, 2.0, 1.0], [-1.0, -1.0, -2.0, -1.0]],
        "bias": [0.0, 0.0],
    }
    return values | changes


@pytest.fixture
def policy() -> Callable[..., str]:
    """Write tiny.json, with these changes, and give its name."""

    def write(**changes: Any) -> str:
        Path("tiny.json").write_text(json.dumps(tiny(**changes)))
        return "tiny.json"

    return write


@pytest.fixture
def calibration(qcompile: Callable[..., Any]) -> str:
    """A calibration of fake_lima in lima.json."""
    words = ("calibrate", "--backend", "fake_lima", "--out", "lima.json", "--seed", 1)
    assert qcompile(*words).code == 0
    return "lima.json"


@pytest.fixture
def run_keys() -> set[str]:
    """The keys of `qcompile run --json`: the contract, and those that came later."""
    documented = """policy environment backend kind shots mitigation level seed episodes mean_reward
        std_reward ci95 solved gates_per_circuit circuits_per_step rounds_per_step executions
        qpu_seconds_estimate env_steps wall_seconds"""
    return {*documented.split(), "greedy", "interrupted", "predistort", "calibration", "copies"} | {
        "calibration_misfits",
        "jobs",
        *("max_steps", "cut_episodes", "mean_reward_completed", "ci95_completed"),
        *("couplings_per_circuit", "observables_per_step"),
        *("hold", "speculate", "measured_rows", "decisions", "split", "calibration_shots"),
    }


@pytest.fixture
def ctrl_c(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Send SIGINT when the n-th episode is counted."""

    def after(episodes: int) -> None:
        counted = 0

        @contextmanager
        def bar(
            title: str, total: float, *, enabled: bool = True
        ) -> Iterator[Callable[[float, str], None]]:
            def show(done: float, words: str) -> None:
                nonlocal counted
                counted += done > 0
                if done and counted == episodes:
                    signal.raise_signal(signal.SIGINT)

            yield show

        monkeypatch.setattr("qcompile.report.progress.progress_bar", bar)

    return after


@pytest.fixture
def left() -> Callable[[], list[str]]:
    """The names of everything in the folder, hidden and temporary files included."""
    return lambda: sorted(str(path) for path in Path().rglob("*"))


@pytest.fixture
def nothing_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    def calibrate(*_: object, **__: object) -> None:
        pytest.fail("measured before the words were checked")

    monkeypatch.setattr("qcompile.verbs.calibrate.measure_qubits", calibrate)
