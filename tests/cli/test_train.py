"""`qcompile train`: the policy, the log, what Ctrl-C leaves, and outputs checked beforehand."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

Call = Callable[..., Any]

SHORT = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 3)


def test_training_writes_a_policy_that_runs(qcompile: Call, left: Call) -> None:
    answer = qcompile(*SHORT, "--out", "mine.pt")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("3 episodes, ")
    assert answer.out.endswith(" parameters in mine.pt\n")
    assert left() == ["mine.pt"]
    assert qcompile("run", "mine.pt", "--episodes", 1).code == 0


def test_the_log_has_a_row_for_each_episode(qcompile: Call) -> None:
    answer = qcompile(*SHORT, "--out", "mine.json", "--log", "logs/log.csv", "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    lines = Path("logs/log.csv").read_text().splitlines()
    assert lines[0] == "episode,steps,reward"
    rows = [[float(value) for value in row] for row in csv.reader(lines[1:])]
    assert [row[0] for row in rows] == [1, 2, 3]
    # One environment that pays 1 for each step: rewards are the lengths of the episodes.
    assert [row[1] for row in rows] == [sum(r[2] for r in rows[: i + 1]) for i in range(3)]
    assert found["episodes"] == 3
    assert found["steps"] == rows[-1][1]
    assert found["last_20_mean_reward"] == pytest.approx(sum(row[2] for row in rows) / 3)
    assert found["out"] == "mine.json"
    assert found["interrupted"] is False


def test_training_repeats_exactly(qcompile: Call) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        words = ("--seed", seed, "--out", f"{name}/p.json", "--log", f"{name}/log.csv")
        assert qcompile(*SHORT, *words).code == 0
    for file in ("p.json", "log.csv"):
        made = [Path(name, file).read_bytes() for name in "abc"]
        assert made[0] == made[1] != made[2]


@pytest.mark.parametrize("as_json", [False, True])
def test_an_interrupted_training_keeps_the_policy(
    qcompile: Call, ctrl_c: Call, left: Call, as_json: bool
) -> None:
    ctrl_c(2)
    words = ("train", "CartPole-v1", "--preset", "paper", "--out", "mine.pt", "--log", "log.csv")
    answer = qcompile(*words, *["--json"] * as_json)
    assert answer.code == 1
    assert (
        answer.err
        == """\
Error: Interrupted.
  The policy trained so far is in mine.pt.
"""
    )
    if as_json:
        assert (answer.json()["interrupted"], answer.json()["episodes"]) == (True, 2)
    assert left() == ["log.csv", "mine.pt"]
    assert len(Path("log.csv").read_text().splitlines()) == 3
    assert qcompile("run", "mine.pt", "--episodes", 1).code == 0


# What is refused, before any training.


@pytest.fixture(autouse=True)
def trainers(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Tests named "refused" fail when anything is trained."""
    if "refused" in request.node.name:
        from qcompile.rl.ppo import Trainer

        def train(*_: object) -> None:
            pytest.fail("trained before everything was checked")

        monkeypatch.setattr(Trainer, "train", train)


BAD_OUTPUTS = {
    "under a file": (
        ("--out", "file/mine.pt"),
        "Error: Cannot write file/mine.pt.\n  file is not a folder.\n  Choose another path.\n",
    ),
    "log under a file": (
        ("--out", "mine.pt", "--log", "file/log.csv"),
        "Error: Cannot write file/log.csv.\n  file is not a folder.\n  Choose another path.\n",
    ),
    "log without a name": (
        ("--out", "mine.pt", "--log", ""),
        "Error: Cannot write ..\n  It is a folder.\n  Choose another path.\n",
    ),
    "long name": (
        ("--out", f"new/{'x' * 252}.pt"),
        f"Error: Cannot write new/{'x' * 252}.pt.\n  File name too long.\n  Choose another path.\n",
    ),
}


@pytest.mark.parametrize("what", BAD_OUTPUTS)
def test_an_output_that_cannot_be_written_is_refused(qcompile: Call, left: Call, what: str) -> None:
    Path("file").touch()
    words, text = BAD_OUTPUTS[what]
    answer = qcompile(*SHORT, *words)
    assert (answer.code, answer.out, answer.err) == (1, "", text)
    assert left() == ["file"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--out", "mine.txt"), "mine.txt must end with .pt or .json."),
        (("--out", "folder.pt"), "File 'folder.pt' is a directory."),
        (
            ("--out", "mine.json", "--log", "./mine.json"),
            "--out and --log are the same file, mine.json.",
        ),
        (("--out", "mine.pt", "--reuse", "0"), "0 is not in the range 1<=x<=1000."),
        (("--out", "mine.pt", "--steps", "0"), "0 is not in the range x>=1."),
        (
            ("--out", "mine.pt", "--preset", "magic"),
            "'magic' is not one of 'paper', 'tuned', 'hardware'.",
        ),
        ((), "Missing option '--out'."),
    ],
)
def test_wrong_usage_is_refused(
    qcompile: Call, left: Call, words: tuple[str, ...], text: str
) -> None:
    Path("folder.pt").mkdir()
    answer = qcompile(*SHORT, *words)
    assert (answer.code, answer.out) == (2, "")
    assert f"{text}\n" in answer.err
    assert left() == ["folder.pt"]


BAD_ENVIRONMENTS = {
    "Nope-v1": "Error: Unknown environment 'Nope-v1'.\n",
    "": "Error: Unknown environment ''.\n",
    "CartPole-v99": "Error: Unknown environment 'CartPole-v99'.\n",
    "Pendulum-v1": "Error: Pendulum-v1 acts in Box(-2.0, 2.0, (1,), float32).\n"
    "  Continuous actions are not supported yet: a policy chooses among numbered actions "
    "(Discrete).\n",
    "CarRacing-v3": "Error: CarRacing-v3 observes 27,648 numbers in total.\n",
    "mine:Corridor-v0": "Error: Environment 'mine:Corridor-v0' would import a module.\n"
    "  Use --import mine and the plain id Corridor-v0.\n",
}


@pytest.mark.parametrize("name", BAD_ENVIRONMENTS)
def test_an_environment_that_does_not_fit_is_refused(qcompile: Call, left: Call, name: str) -> None:
    answer = qcompile("train", name, "--out", "mine.pt")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(BAD_ENVIRONMENTS[name])
    assert left() == []


def test_an_environment_without_its_package_is_refused(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    import gymnasium

    def make(*_: object, **__: object) -> None:
        raise gymnasium.error.DependencyNotInstalled("Box2D is not installed, run `pip ...`")

    monkeypatch.setattr(gymnasium, "make", make)
    answer = qcompile("train", "LunarLander-v3", "--out", "mine.pt")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Environment 'LunarLander-v3' needs a package that is not installed.
  Box2D is not installed, run `pip ...`
"""
    )


class Breaks(gymnasium.Env[Any, Any]):
    """Its observations are not numbers from the 90th step of its life on; episodes last 20."""

    observation_space = Box(-1, 1, (2,), np.float32)
    action_space = Discrete(2)
    life = 0

    def __init__(self, render_mode: str | None = None):
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(2, np.float32), {}

    def step(self, action: Any) -> Any:
        self.steps += 1
        self.life += 1
        seen = np.full(2, np.nan if self.life == 90 else 0.1, np.float32)
        return seen, 1.0, self.steps == 20, False, {}


def test_an_environment_that_breaks_leaves_the_policy_of_the_last_update(
    qcompile: Call, left: Call
) -> None:
    """Four whole episodes are learned from; the tenth step of the fifth breaks."""
    gymnasium.register("Breaks-v0", Breaks)
    try:
        words = ("train", "Breaks-v0", "--preset", "paper", "--episodes", 9, "--out", "mine.pt")
        answer = qcompile(*words, "--log", "log.csv", "--checkpoint", "state")
        assert answer.code == 1
        assert answer.err.startswith("Error: Breaks-v0, episode of seed ")
        assert answer.err.endswith(
            ", step 10: feature 0 of the observation is nan.\n  Observations must be finite.\n"
            "  The policy after the last complete update is in mine.pt.\n"
        )
        assert answer.out.startswith("4 episodes, 89 steps, last 20: 20.0; ")
        assert left() == ["log.csv", "mine.pt", "state"]
        assert len(Path("log.csv").read_text().splitlines()) == 5
        assert qcompile("run", "mine.pt", "--episodes", 2).code == 0
    finally:
        del gymnasium.registry["Breaks-v0"]
