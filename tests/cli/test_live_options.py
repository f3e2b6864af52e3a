"""Money needs words: the options of live runs, alone and together."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.noise import usable

Call = Callable[..., Any]


@pytest.fixture(autouse=True)
def _no_account(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whatever is forgotten here may not reach anybody."""
    monkeypatch.setenv("QISKIT_IBM_URL", "http://127.0.0.1:9/experimental")
    monkeypatch.setenv("IAM_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("QCOMPILE_PATIENCE_SECONDS", "0.1")


@pytest.fixture
def commands() -> dict[str, tuple[str, ...]]:
    """Each command that can run live, with what it needs besides."""
    device = load_device("fake_lima")
    calibrate(OfflineExecutor(device), usable(device), None).save(Path("lima.json"))
    return {
        "run": ("run", "cartpole", "--backend", "fake_lima", "--max-steps", "1", "--shots", "10"),
        "calibrate": ("calibrate", "--backend", "fake_lima", "--shots", "10"),
        "validate": ("validate", "lima.json", "--policy", "cartpole"),
    }


@pytest.mark.parametrize("name", ["run", "calibrate", "validate"])
def test_live_needs_a_limit(qcompile: Call, commands: dict[str, Any], name: str) -> None:
    answer = qcompile(*commands[name], "--live", "--yes")
    assert (answer.code, answer.out) == (2, "")
    assert "--live needs --max-qpu-seconds" in answer.err
    assert "`qcompile plan` says how many it takes." in answer.err


@pytest.mark.parametrize("name", ["run", "calibrate", "validate"])
@pytest.mark.parametrize(
    "words",
    [
        ("--max-qpu-seconds", "5"),
        ("--yes",),
        ("--account", "mine"),
        ("--instance", "mine"),
        ("--batch",),
        ("--max-wait-seconds", "5"),
    ],
    ids=lambda words: words[0],
)
def test_options_of_live_runs_need_live(
    qcompile: Call, commands: dict[str, Any], name: str, words: tuple[str, ...]
) -> None:
    answer = qcompile(*commands[name], *words)
    assert (answer.code, answer.out) == (2, "")
    assert f"{words[0]} needs --live." in answer.err


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "some", "1e7", "inf"])
def test_a_limit_is_a_number_above_zero(
    qcompile: Call, commands: dict[str, Any], seconds: str
) -> None:
    answer = qcompile(*commands["run"], "--live", "--max-qpu-seconds", seconds)
    assert (answer.code, answer.out) == (2, "")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("run", ("--shots", "exact")),
        ("run", ("--video", "a.gif")),
        ("calibrate", ("--shots", "exact")),
        ("calibrate", ("--seed", "3")),
        ("validate", ("--backend", "fake_lima")),
    ],
)
def test_what_a_machine_cannot_do_is_wrong_usage(
    qcompile: Call, commands: dict[str, Any], name: str, words: tuple[str, ...]
) -> None:
    answer = qcompile(*commands[name], *words, "--live", "--max-qpu-seconds", "5")
    assert (answer.code, answer.out) == (2, "")
    assert words[0].removeprefix("--") in answer.err


@pytest.mark.parametrize("name", ["run", "calibrate", "validate"])
@pytest.mark.parametrize("said", ["soon", "", "-1", "nan", "inf"])
def test_a_patience_that_is_no_number_of_seconds_is_explained(
    qcompile: Call,
    commands: dict[str, Any],
    name: str,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("QCOMPILE_PATIENCE_SECONDS", said)
    answer = qcompile(*commands[name], "--live", "--max-qpu-seconds", "5", "--yes")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == (
        f"Error: QCOMPILE_PATIENCE_SECONDS is {said!r}.\n"
        "  It must be a number of seconds, such as 300, and at most a day.\n"
    )
    assert not Path("runs").exists()


def test_nothing_of_it_matters_to_what_is_not_live(
    qcompile: Call, commands: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QCOMPILE_PATIENCE_SECONDS", "soon")
    assert qcompile(*commands["run"], "--episodes", "1").code == 0
