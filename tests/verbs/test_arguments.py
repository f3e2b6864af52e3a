"""Arguments that no verb can take are refused in words before anything is done."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.errors import CalibrationError, CountsError, OptionError, PolicyError, QcompileError

VERBS: dict[str, dict[str, Any]] = {
    "run": {"policy": "cartpole", "episodes": 1, "max_steps": 1, "shots": 8},
    "evaluate": {"policies": "cartpole", "backends": "ideal"},
    "train": {"environment": "CartPole-v1"},
    "calibrate": {"backend": "ibm_lima"},
    "plan": {"policy": "cartpole", "max_steps": 1},
    "study": {"rows": "cartpole"},
    "validate": {"calibration": "none.json"},
}
NOTHING = object()


def verb(name: str) -> Callable[..., Any]:
    return getattr(qcompile, name)  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        (name, parameter.name)
        for name in VERBS
        for parameter in inspect.signature(verb(name)).parameters.values()
        if parameter.name != "sampler"  # anything may be one; its first job tells
    ],
)
def test_no_argument_may_be_just_anything(name: str, argument: str) -> None:
    with pytest.raises(QcompileError):
        verb(name)(**(VERBS[name] | {argument: NOTHING}))


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("run", {"episodes": "8"}, "episodes cannot be '8'"),
        ("run", {"shots": math.nan}, "shots cannot be nan"),
        ("run", {"shots": True}, "shots cannot be True"),
        ("run", {"greedy": "no"}, "greedy cannot be 'no'"),
        ("run", {"video": "a\0b.gif"}, "video cannot be"),
        ("run", {"live": True}, "live cannot be True"),
        ("plan", {"copies": 0}, "copies cannot be 0"),
        ("plan", {"usd_per_second": math.nan}, "usd_per_second cannot be nan"),
        ("plan", {"shots": "exact"}, "shots cannot be 'exact'"),
        ("calibrate", {"seed": -1}, "seed cannot be -1"),
        ("train", {"evaluate_every": 0}, "evaluate_every cannot be 0"),
        ("study", {"seeds": 2**32}, r"It must be in \[1, 1000\]"),
        ("evaluate", {"levels": {2}}, "levels cannot be"),
    ],
)
def test_what_is_wrong_is_said(name: str, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        verb(name)(**(VERBS[name] | arguments))


def test_the_numbers_of_numpy_are_numbers() -> None:
    shots = np.array([8, 16])
    grid = qcompile.evaluate(
        "cartpole",
        shots=shots,
        backends="ideal",
        mitigations="none",
        episodes=np.int64(1),  # type: ignore[arg-type]
        seed=np.array(3),  # type: ignore[arg-type]
        workers=1,
        progress=False,
    )
    assert [cell["shots"] for cell in grid.cells[1:]] == [8, 16]
    assert grid.cells[1]["episodes"][0]["seed"] == 3


def test_files_are_names() -> None:
    with pytest.raises(PolicyError, match="not an object of type NoneType"):
        qcompile.load_policy(None)  # type: ignore[arg-type]
    with pytest.raises(CalibrationError, match="found an object of type int"):
        qcompile.load_calibration(3)  # type: ignore[arg-type]


def test_a_device_has_no_qubit_below_0_and_none_of_half() -> None:
    for qubits in ([-1], [0, 5], [2**64]):
        with pytest.raises(CalibrationError, match="ibm_lima has no qubit"):
            qcompile.calibrate("ibm_lima", qubits, progress=False)


def test_more_shots_than_a_job_holds_are_not_validated(tmp_path: Path) -> None:
    calibration = qcompile.calibrate("ibm_lima", shots=64, seed=0, progress=False)
    for shots in (0, 2**64):
        with pytest.raises(CountsError):
            qcompile.validate(calibration, policy="cartpole", observations=2, shots=shots)


@pytest.mark.parametrize("seconds", [math.nan, math.inf, -1.0, 0, "60", None, True])
def test_a_limit_is_a_number_that_limits(seconds: Any) -> None:
    with pytest.raises(OptionError, match="max_qpu_seconds cannot be"):
        qcompile.Live(max_qpu_seconds=seconds)
