"""What a command prints with --json is what its function gives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import qcompile as q

Call = Callable[..., Any]


def timeless(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key not in ("wall_seconds", "created")}


def test_run(qcompile: Call) -> None:
    words = ("--backend", "fake_lima", "--episodes", 2, "--max-steps", 4, "--shots", 64, "--json")
    result = q.run("cartpole", "fake_lima", episodes=2, max_steps=4, shots=64)
    assert timeless(qcompile("run", "cartpole", *words).json()) == timeless(result.to_dict())


def test_evaluate(qcompile: Call) -> None:
    words = ("--backend", "fake_lima", "--episodes", 1, "--shots", 16, "--workers", 1, "--json")
    document = qcompile("evaluate", "cartpole", *words).json()
    grid = q.evaluate("cartpole", "fake_lima", shots=16, episodes=1, workers=1)
    assert [*document] == [*grid.to_dict()]
    assert [*map(timeless, document["results"])] == [*map(timeless, grid.cells)]


def test_plan(qcompile: Call) -> None:
    document = qcompile("plan", "cartpole", "--max-steps", 2, "--shots", 100, "--json").json()
    assert document == q.plan("cartpole", max_steps=2, shots=100).to_dict()


def test_train(qcompile: Call) -> None:
    words = ("--preset", "paper", "--episodes", 3, "--set", "clip=0.3", "--out", "a.json", "--json")
    document = qcompile("train", "CartPole-v1", *words).json()
    training = q.train(
        "CartPole-v1", preset="paper", episodes=3, settings={"clip": 0.3}, out="b.json"
    )
    assert document == training.to_dict() | {"out": "a.json"}
    a, b = (Path(name).read_text() for name in ("a.json", "b.json"))
    assert a.replace('"name": "a"', '"name": "b"') == b


def test_calibrate_and_validate(qcompile: Call) -> None:
    words = ("--backend", "fake_lima", "--shots", 500, "--seed", 3)
    assert qcompile("calibrate", *words, "--out", "lima.json").code == 0
    calibration = q.calibrate("fake_lima", shots=500, seed=3)
    document = qcompile("calibrate", *words, "--out", "again.json", "--json").json()
    assert timeless(document) == timeless(calibration.to_dict()) | {"file": "again.json"}
    stored = q.load_calibration("lima.json")
    assert stored.model_copy(update={"created": calibration.created}) == calibration

    check = ("--policy", "cartpole", "--observations", 3, "--shots", 100, "--json")
    document = qcompile("validate", "lima.json", *check).json()
    validation = q.validate("lima.json", policy="cartpole", observations=3, shots=100)
    assert document == validation.to_dict()


def test_a_result_is_kept_as_its_document(qcompile: Call) -> None:
    result = q.plan("cartpole", max_steps=2, shots=100)
    result.save("plan.json")
    words = ("plan", "cartpole", "--max-steps", 2, "--shots", 100, "--json")
    assert Path("plan.json").read_text() == qcompile(*words).out
