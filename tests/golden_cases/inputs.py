"""Files that cases read, and changes of the world around them."""

from __future__ import annotations

import functools
import json
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate

from .case import Change

ENCODER: dict[str, Any] = {"function": "arctan", "feature": [0, 1, 2, 3], "scale": [1.0] * 4}


def policy(**changes: Any) -> dict[str, Any]:
    """A policy for CartPole with a circuit for each feature; a change to None takes a key away."""
    values: dict[str, Any] = {
        "format": "qcompile-policy-1",
        "name": "tiny",
        "environment": "CartPole-v1",
        "encoder": ENCODER,
        "circuits": [[["h"], ["ry", f"x{i}"], ["rz", f"x{i}"], ["ry", "theta0"]] for i in range(4)],
        "theta": [0.1],
        "weights": [[1.0, 1.0, 2.0, 1.0], [-1.0, -1.0, -2.0, -1.0]],
        "bias": [0.0, 0.0],
    }
    return {key: value for key, value in (values | changes).items() if value is not None}


def network(**changes: Any) -> dict[str, Any]:
    """A network for CartPole with a hidden layer of two; a change to None takes a key away."""
    hidden = {"type": "dense", "weights": [[0.0, 0.0, 1.0, 0.5]] * 2, "bias": [0.0, 0.5]}
    head = {"type": "dense", "weights": [[-1.0, -1.0], [1.0, 1.0]], "bias": [0.5, 0.0]}
    values: dict[str, Any] = {
        "format": "qcompile-network-1",
        "name": "net",
        "environment": "CartPole-v1",
        "layers": [hidden | {"activation": "tanh"}, head],
    }
    return {key: value for key, value in (values | changes).items() if value is not None}


def device(**changes: Any) -> dict[str, Any]:
    """The device file of fake_lima, called `mine`; a change to None takes a key away."""
    values = json.loads(load_device("fake_lima").to_json()) | {"name": "mine"} | changes
    return {key: value for key, value in values.items() if value is not None}


def with_qubit(index: int = 1, **changes: Any) -> dict[str, Any]:
    """That device with another qubit in place of this one."""
    values = device()
    values["qubits"][index] = {
        key: value
        for key, value in (values["qubits"][index] | changes).items()
        if value is not None
    }
    return values


@functools.cache
def _calibrated(
    backend: str, qubits: tuple[int, ...], shots: int | None, parts: Any
) -> Calibration:
    executor = OfflineExecutor(load_device(backend), seed=1)
    return calibrate(executor, np.array(qubits), shots, parts=parts)


def calibration(
    on: str = "fake_lima",
    of: tuple[int, ...] = (0, 1, 2, 3, 4),
    shots: int | None = None,
    parts: tuple[str, ...] = ("readout", "response"),
    **changes: Any,
) -> dict[str, Any]:
    """The file of a calibration of the device `on`, measured now; a change to None takes a key
    away."""
    values = _calibrated(on, of, shots, parts).model_dump(mode="json")
    values |= {"created": hours_ago(0)} | changes
    return {key: value for key, value in values.items() if value is not None}


def hours_ago(hours: float) -> str:
    return (datetime.now(UTC) - timedelta(hours=hours)).isoformat()


def write(files: Mapping[str, Any]) -> None:
    """Write each text, these bytes or this JSON document to its path."""
    for name, contents in files.items():
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(contents, bytes):
            path.write_bytes(contents)
        else:
            path.write_text(contents if isinstance(contents, str) else json.dumps(contents))


# Changes


def without(module: str) -> Change:
    """A package is not installed."""
    return lambda patch: patch.setitem(sys.modules, module, None)


def setting(name: str, value: Any) -> Change:
    """Something in qcompile is another."""
    return lambda patch: patch.setattr(name, value)


def ctrl_c_after(episodes: int) -> Change:
    """Ctrl-C is pressed when so many episodes have been counted."""

    def change(patch: pytest.MonkeyPatch) -> None:
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

        patch.setattr("qcompile.report.progress.progress_bar", bar)

    return change


def ctrl_c_in(name: str) -> Change:
    """Ctrl-C is pressed when this function is called."""

    def change(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(name, lambda *_, **__: signal.raise_signal(signal.SIGINT))

    return change
