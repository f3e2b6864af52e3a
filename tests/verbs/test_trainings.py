"""`qcompile.train` with several seeds: each as it is alone, and the best by fresh episodes."""

from __future__ import annotations

import csv
from copy import copy
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import qcompile
from qcompile.errors import OptionError, OutputError, QcompileError, StudyError
from qcompile.verbs import train_seeds
from qcompile.verbs.trainings import Trainings

PAPER: dict[str, Any] = {"preset": "paper", "episodes": 6}


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Trainings, Path]:
    """Seeds 3 and 4 in two processes, with all their files."""
    folder = tmp_path_factory.mktemp("both")
    files = {name: folder / name for name in ("log.csv", "moon.state", "runs", "best.json")}
    result = qcompile.train(
        "CartPole-v1",
        **PAPER,
        seed=3,
        seeds=2,
        evaluation=30,
        log=files["log.csv"],
        checkpoint=files["moon.state"],
        tensorboard=files["runs"],
        out=files["best.json"],
    )
    assert isinstance(result, Trainings)
    return result, folder


def test_each_is_the_training_of_its_seed(both: tuple[Trainings, Path]) -> None:
    result, folder = both
    result.check_complete()
    for seed, training in zip((3, 4), result.trainings, strict=True):
        log = Path(f"log-{seed}.csv")
        alone = qcompile.train("CartPole-v1", **PAPER, seed=seed, log=log)
        assert training.rewards == alone.rewards
        assert (folder / log).read_bytes() == log.read_bytes()
        assert training.policy is not None
        assert alone.policy is not None
        np.testing.assert_array_equal(training.policy.theta, alone.policy.theta)
        np.testing.assert_array_equal(training.policy.weights, alone.policy.weights)
        resumed = qcompile.train("CartPole-v1", resume=folder / f"moon-{seed}.state")
        assert resumed.rewards == alone.rewards
    kept = ["best.json", "log-3.csv", "log-4.csv", "moon-3.state", "moon-4.state", "runs"]
    assert sorted(path.name for path in folder.iterdir()) == kept
    assert sorted(path.name for path in (folder / "runs").iterdir()) == ["seed-3", "seed-4"]


def test_the_best_by_fresh_episodes_is_written_and_scored_on_others(
    both: tuple[Trainings, Path],
) -> None:
    """The same numbers as `qcompile run` has from the same reset seeds."""
    result, folder = both
    document = result.to_dict()

    def played(policy: Any, seed: int) -> dict[str, float]:
        rewards = np.array(qcompile.run(policy, shots="exact", episodes=30, seed=seed).rewards)
        return {"mean_reward": rewards.mean(), "std_reward": rewards.std()}

    scores = [played(training.policy, 2_000_000) for training in result.trainings]
    for training, score in zip(document["trainings"], scores, strict=True):
        assert {name: training[name] for name in score} == pytest.approx(score)
    means = [score["mean_reward"] for score in scores]
    assert document["mean_reward"] == pytest.approx(np.mean(means))
    assert document["std_reward"] == pytest.approx(np.std(means))
    best = int(np.argmax(means))
    assert document["best"]["seed"] == 3 + best
    stored = qcompile.load_policy(folder / "best.json")
    expected = played(stored, 3_000_000)
    assert {name: document["best"][name] for name in expected} == pytest.approx(expected)
    assert stored.metadata["seed"] == 3 + best
    assert result.rewards == result.trainings[best].rewards
    assert result.policy is not None
    assert result.policy.name == stored.name == "best"


def test_all_are_shown(both: tuple[Trainings, Path]) -> None:
    result, _ = both
    lines = repr(result).splitlines()
    assert [line.split()[:2] for line in lines[1:3]] == [["3", "6"], ["4", "6"]]
    assert lines[3].startswith("mean of 2 seeds: ")
    assert lines[3].endswith(" on 30 other episodes")
    assert result.plot().png != result.trainings[0].plot().png
    one = qcompile.train("CartPole-v1", preset="paper", episodes=2)
    assert one.trainings == [one]
    assert not isinstance(one, Trainings)


class Ends:
    """Stands for the engine: trains in this process, and ends as it is told to after `count`."""

    def __init__(self, count: int, error: type[BaseException] | BaseException | None):
        self.count, self.error = count, error

    def __call__(self, cells: Any, run: Any, on_result: Any, **_: Any) -> None:
        for cell in cells[: self.count]:
            on_result(cell, run(cell))
        if self.error is not None:
            raise self.error


def test_ctrl_c_keeps_what_is_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_seeds, "run_all", Ends(2, KeyboardInterrupt))
    options = {"seeds": 4, "evaluation": 2, "out": "p.pt"}
    result = qcompile.train("CartPole-v1", **PAPER, **options)  # type: ignore[arg-type]
    assert result.interrupted
    assert result.to_dict()["seeds"] == [0, 1]
    with pytest.raises(QcompileError) as caught:
        result.check_complete()
    assert str(caught.value) == (
        "Interrupted: 2 of 4 trainings finished.\n  The best policy of these is in p.pt."
    )
    assert qcompile.load_policy("p.pt").metadata["seed"] in (0, 1)
    monkeypatch.setattr(train_seeds, "run_all", Ends(0, KeyboardInterrupt))
    with pytest.raises(QcompileError, match=r"^Interrupted: 0 of 4 trainings finished\.$"):
        qcompile.train("CartPole-v1", seeds=4)


def test_lost_workers_leave_what_is_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = StudyError("Workers were lost 3 times.", "The same command resumes from there.")
    monkeypatch.setattr(train_seeds, "run_all", Ends(1, lost))
    result = qcompile.train("CartPole-v1", **PAPER, seeds=3, evaluation=2, out="p.pt")
    assert result.to_dict()["seeds"] == [0]
    with pytest.raises(QcompileError) as caught:
        result.check_complete()
    assert str(caught.value) == (
        "Workers were lost 3 times.\n  1 of 3 trainings finished.\n"
        "  The best policy of these is in p.pt."
    )
    monkeypatch.setattr(train_seeds, "run_all", Ends(0, lost))
    with pytest.raises(QcompileError, match=r"^Workers were lost 3 times\.$"):
        qcompile.train("CartPole-v1", seeds=3)


def test_a_seed_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    from qcompile.rl.ppo import Trainer

    update = Trainer._update

    def diverges(trainer: Trainer, rollout: Any) -> None:
        if trainer.seed != 1:
            raise qcompile.QcompileError("It diverged.")
        update(trainer, rollout)

    monkeypatch.setattr(Trainer, "_update", diverges)
    monkeypatch.setattr(train_seeds, "run_all", Ends(2, None))
    result = qcompile.train("CartPole-v1", **PAPER, seeds=2, evaluation=2)
    assert result.to_dict()["failures"] == [{"seed": 0, "words": "It diverged."}]
    assert result.to_dict()["std_reward"] is None
    with pytest.raises(QcompileError) as caught:
        result.check_complete()
    assert str(caught.value) == "1 of 2 trainings finished.\n  Seed 0: It diverged."
    with pytest.raises(QcompileError, match=r"^0 of 1 trainings finished.\n  Seed 7: It div"):
        qcompile.train("CartPole-v1", **PAPER, seed=7, seeds=1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"resume": "state"},
            "resume cannot be combined with seeds: a checkpoint belongs to one training.",
        ),
        ({"callback": print}, "callback cannot be combined with seeds, which are trained in"),
        ({"seeds": None, "workers": 2}, "workers needs seeds, the number of trainings."),
        ({"seeds": None, "evaluation": 2}, "evaluation needs seeds, the number of trainings."),
        ({"seeds": 0}, "seeds cannot be 0.\n  It must be in [1, 1000]."),
        ({"out": "p-1.pt", "checkpoint": "p.pt"}, "out and checkpoint are the same file, p-1.pt."),
    ],
)
def test_what_goes_with_one_training_is_refused(
    options: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train_seeds, "run_all", lambda *_, **__: pytest.fail("trained"))
    with pytest.raises(OptionError) as caught:
        qcompile.train("CartPole-v1", **({"seeds": 2} | options))
    assert str(caught.value).startswith(words)
    assert list(Path().iterdir()) == []


def test_the_files_of_every_seed_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_seeds, "run_all", lambda *_, **__: pytest.fail("trained"))
    Path("moon-1.state").write_text("kept")
    with pytest.raises(OutputError, match=r"^moon-1\.state already exists\."):
        qcompile.train("CartPole-v1", seeds=2, checkpoint="moon.state")
    assert Path("moon-1.state").read_text() == "kept"


def corridor() -> type[gymnasium.Env[Any, Any]]:
    """A class that is in no module, as those of a notebook: workers must be sent it."""

    class Passage(gymnasium.Env[Any, Any]):
        observation_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)
        action_space = gymnasium.spaces.Discrete(2)

        def __init__(self, length: int = 3):
            self.length = length

        def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
            super().reset(seed=seed)
            self.left = self.length
            return np.zeros(1, np.float32), {}

        def step(self, action: Any) -> Any:
            self.left -= 1
            return np.zeros(1, np.float32), 1.0, self.left == 0, False, {}

    return Passage


def test_an_environment_of_one_s_own_reaches_the_workers() -> None:
    try:
        result = qcompile.train(
            corridor(), **PAPER, env={"length": 5}, seeds=2, workers=2, evaluation=2
        )
        result.check_complete()
        document = result.to_dict()
        assert document["environment_kwargs"] == {"length": 5}
        assert (document["mean_reward"], document["std_reward"]) == (5.0, 0.0)
        assert document["best"]["seed"] == 0  # of equal ones the lowest
    finally:
        del gymnasium.registry["Passage-v0"]


def test_the_table_has_every_number_and_says_what_is_missing(
    both: tuple[Trainings, Path],
) -> None:
    result, _ = both
    rows = [*csv.DictReader(result.table().csv().splitlines())]
    for row, one in zip(rows, result.to_dict()["trainings"], strict=True):
        names = ("30 fresh episodes, mean", "30 fresh episodes, standard deviation")
        assert [float(row[name]) for name in names] == [one["mean_reward"], one["std_reward"]]
        assert float(row["last 20"]) == one["last_20_mean_reward"]
    assert not result.table().notes
    fewer = copy(result)
    fewer._requested = 3
    assert [*fewer.table().notes] == ["2 of 3 trainings finished."]
