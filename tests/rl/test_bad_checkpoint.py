"""Files that are not checkpoints, or were tampered with: refused, and none of their code is run."""

from __future__ import annotations

import json
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.errors import EnvironmentMismatchError, TrainingError
from qcompile.policy import save_policy
from qcompile.rl.checkpoint import load_checkpoint
from qcompile.rl.checkpoint_file import FORMAT
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings

SavedAt = Callable[..., None]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory, saved_at: SavedAt) -> bytes:
    """A small checkpoint of every part, with Algorithm 2 and noise."""
    path = tmp_path_factory.mktemp("good") / "run.checkpoint"
    settings = Settings(episodes=9, pause_at=5.0, shots=16)
    saved_at(3, "Match-v0", settings, path)
    return path.read_bytes()


def refused(path: Path) -> str:
    """One TrainingError, with a short message and the name of the file."""
    with pytest.raises(TrainingError) as caught:
        load_checkpoint(path)
    message = str(caught.value)
    assert len(message.splitlines()) <= 3
    assert str(path) in message
    return message


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    message = refused(tmp_path / "none.checkpoint")
    assert message.startswith("There is no checkpoint ")


def as_empty(path: Path) -> None:
    path.write_bytes(b"")


def as_text(path: Path) -> None:
    path.write_text("format: qcompile-checkpoint-1\n")


def as_noise(path: Path) -> None:
    path.write_bytes(np.random.default_rng(0).bytes(5000))


def as_folder(path: Path) -> None:
    path.mkdir()


def as_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("readme", "nothing")


def as_policy(path: Path) -> None:
    policy = Trainer("Match-v0", Settings(episodes=1), 0).policy()
    assert policy is not None
    save_policy(policy, path)


def as_tensor(path: Path) -> None:
    torch.save(torch.zeros(3), path)


def as_model(path: Path) -> None:
    torch.save(torch.nn.Linear(2, 2).state_dict(), path)


def as_whole_module(path: Path) -> None:
    torch.save(torch.nn.Linear(2, 2), path)


def as_pickle(path: Path) -> None:
    path.write_bytes(pickle.dumps({"format": FORMAT}))


WRONG = (as_empty, as_text, as_noise, as_folder, as_zip, as_policy, as_tensor, as_model)


@pytest.mark.parametrize("make", [*WRONG, as_whole_module, as_pickle])
def test_a_file_of_another_kind_is_refused(make: Callable[[Path], None], tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    make(path)
    refused(path)


class Bomb:
    """Unpickled, it makes a file."""

    def __init__(self, marker: Path):
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return (open, (str(self.marker), "w"))


@pytest.mark.parametrize("way", ["torch", "old torch", "pickle", "within"])
def test_a_pickle_that_would_run_code_is_not_run(way: str, good: bytes, tmp_path: Path) -> None:
    path, marker = tmp_path / "run.checkpoint", tmp_path / "marker"
    if way == "pickle":
        path.write_bytes(pickle.dumps(Bomb(marker)))
    elif way == "within":
        path.write_bytes(good)
        torch.save({**torch.load(path, weights_only=True), "plain": Bomb(marker)}, path)
    else:
        torch.save(Bomb(marker), path, _use_new_zipfile_serialization=way == "torch")
    refused(path)
    assert not marker.exists()
    if way == "pickle":
        pickle.loads(path.read_bytes()).close()
        assert marker.exists(), "the file should run code"


def test_a_file_cut_short_is_refused(good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    for share in (0.01, 0.2, 0.5, 0.9, 0.99):
        path.write_bytes(good[: int(share * len(good))])
        refused(path)


def altered(good: bytes, path: Path, **parts: Any) -> None:
    path.write_bytes(good)
    torch.save({**torch.load(path, weights_only=True), **parts}, path)


def test_what_is_altered_below_is_read_unaltered(good: bytes, tmp_path: Path) -> None:
    altered(good, tmp_path / "run.checkpoint")
    assert load_checkpoint(tmp_path / "run.checkpoint")[0].steps == 60


@pytest.mark.parametrize("found", ["qcompile-checkpoint-2", None, 1])
def test_another_format_is_refused(found: Any, good: bytes, tmp_path: Path) -> None:
    altered(good, tmp_path / "run.checkpoint", format=found)
    message = refused(tmp_path / "run.checkpoint")
    assert f"its format is {found!r}" in message
    assert "'qcompile-checkpoint-1'" in message


PARTS = ["environment", "settings", "seed", "versions", "tensors", "plain"]


@pytest.mark.parametrize("part", PARTS)
def test_a_missing_part_is_named(part: str, good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    saved = torch.load(path, weights_only=True)
    del saved[part]
    torch.save(saved, path)
    message = refused(path)
    assert re.fullmatch(rf"Checkpoint .* is damaged\.\n  Missing: {part}\.", message)


VALUES = {
    "none": None,
    "number": 3.5,
    "text": "x",
    "list": [1],
    "dict": {},
    "zeros": torch.zeros(2),
}

WRONG_PARTS = [
    (part, value)
    for part in PARTS
    for value in VALUES
    # a missing name is told as such in test_a_checkpoint_of_another_shape_is_refused, and no
    # versions at all differ in nothing
    if (part, value) not in {("environment", "text"), ("versions", "dict")}
]


@pytest.mark.parametrize(("part", "value"), WRONG_PARTS)
def test_a_part_of_another_type_is_refused(
    part: str, value: str, good: bytes, tmp_path: Path
) -> None:
    altered(good, tmp_path / "run.checkpoint", **{part: VALUES[value]})
    refused(tmp_path / "run.checkpoint")


TENSORS = ["actor", "critic", "optimiser", "generator", "pause"]


@pytest.mark.parametrize("value", ["missing", *VALUES])
@pytest.mark.parametrize("name", TENSORS)
def test_wrong_tensors_are_refused(name: str, value: str, good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    tensors = torch.load(path, weights_only=True)["tensors"]
    if value == "missing":
        del tensors[name]
    else:
        tensors[name] = VALUES[value]
    altered(good, path, tensors=tensors)
    refused(path)


@pytest.mark.parametrize("value", ["missing", "none", "number", "text", "list", "dict"])
@pytest.mark.parametrize("name", ["rng", "collector", "return_scale", "noise"])
def test_wrong_plain_values_are_refused(name: str, value: str, good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    values = json.loads(torch.load(path, weights_only=True)["plain"])
    if value == "missing":
        del values[name]
    else:
        values[name] = VALUES[value]
    altered(good, path, plain=json.dumps(values))
    refused(path)


def set_steps(collector: dict[str, Any]) -> None:
    collector["steps"] = "many"


def set_walks(collector: dict[str, Any]) -> None:
    collector["walks"] = []


def set_seed(collector: dict[str, Any]) -> None:
    collector["walks"][0][0] = -1


def set_observations(collector: dict[str, Any]) -> None:
    collector["observations"] = [["x"]]


def set_episodes(collector: dict[str, Any]) -> None:
    collector["episodes"] = [[1]]


def set_reward(collector: dict[str, Any]) -> None:
    collector["episodes"] = [[1, "much"]]


CHANGES = [set_steps, set_walks, set_seed, set_observations, set_episodes, set_reward]


@pytest.mark.parametrize("change", CHANGES)
def test_experience_that_makes_no_sense_is_refused(
    change: Callable[[dict[str, Any]], None], good: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    values = json.loads(torch.load(path, weights_only=True)["plain"])
    change(values["collector"])
    altered(good, path, plain=json.dumps(values))
    with pytest.raises(TrainingError):
        load_checkpoint(path)


def test_an_action_that_an_environment_has_not_is_refused(
    tmp_path: Path, saved_at: SavedAt
) -> None:
    """CartPole asserts that its actions are 0 and 1."""
    path = tmp_path / "run.checkpoint"
    saved_at(1, "CartPole-v1", Settings(environments=3, horizon=40, steps=960), path)
    saved = torch.load(path, weights_only=True)
    values = json.loads(saved["plain"])
    walk = next(walk for walk in values["collector"]["walks"] if walk[1])
    walk[1][0] = 5
    torch.save({**saved, "plain": json.dumps(values)}, path)
    with pytest.raises(TrainingError):
        load_checkpoint(path)


def test_a_checkpoint_of_another_shape_is_refused(good: bytes, tmp_path: Path) -> None:
    """Settings, environment and tensors must belong to one training."""
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    settings = json.loads(torch.load(path, weights_only=True)["settings"])
    for change in ({"reuse": 3}, {"layout": "serial", "scales": [1.0, 1.0]}, {"gamma": 7}):
        altered(good, path, settings=json.dumps(settings | change))
        with pytest.raises(TrainingError):
            load_checkpoint(path)
    altered(good, path, environment="CartPole-v1")
    refused(path)
    for environment in ("Nowhere-v0", "trojan:Horse-v0"):
        altered(good, path, environment=environment)
        with pytest.raises(EnvironmentMismatchError, match=environment):
            load_checkpoint(path)


def test_a_model_that_the_file_does_not_hold_is_not_built(
    tmp_path: Path, saved_at: SavedAt
) -> None:
    """The settings ask for 4 billion numbers; refused before any of them is made."""
    path = tmp_path / "run.checkpoint"
    saved_at(1, "CartPole-v1", Settings(model="fcn", hidden=(4,), episodes=6), path)
    settings = json.loads(torch.load(path, weights_only=True)["settings"])
    words = {
        "hidden": ([10_000] * 40, r"Its actor has 30 numbers; its settings need 3,900,\d+,\d+\."),
        "critic_hidden": ([10_000] * 9, r"Its critic has 25 numbers; its settings need 800,"),
        "environments": (10_000, r"It has 1 environments; its settings say 10000\."),
    }
    for name, (value, message) in words.items():
        change = {name: value, "horizon": 10}
        altered(path.read_bytes(), tmp_path / "altered", settings=json.dumps(settings | change))
        with pytest.raises(TrainingError, match=message):
            load_checkpoint(tmp_path / "altered")


def test_an_average_must_be_that_of_the_settings(tmp_path: Path, saved_at: SavedAt) -> None:
    path = tmp_path / "run.checkpoint"
    saved_at(1, "Match-v0", Settings(episodes=9, average_share=0.5), path)
    good = path.read_bytes()
    saved = torch.load(path, weights_only=True)
    settings, tensors = json.loads(saved["settings"]), saved["tensors"]
    average = tensors["average"]
    wrong = {
        "It has no average, but its settings have average_share 0.5.": {
            "tensors": {**tensors, "average": None}
        },
        "It has an average, but its settings have average_share 0.0.": {
            "settings": json.dumps(settings | {"average_share": 0.0})
        },
        "Its average contains a number that is not finite.": {
            "tensors": tensors
            | {
                "average": average
                | {"model": average["model"] | {"head.bias": torch.full((2,), torch.nan)}}
            }
        },
        "Its average has 0 numbers": {"tensors": tensors | {"average": average | {"model": {}}}},
        "tensors.average.updates": {"tensors": tensors | {"average": average | {"updates": -1}}},
    }
    for message, parts in wrong.items():
        altered(good, path, **parts)
        assert message in refused(path)


def test_a_checkpoint_of_a_version_without_averages_is_read(good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    saved = torch.load(path, weights_only=True)
    settings = json.loads(saved["settings"])
    del saved["tensors"]["average"], settings["average_share"]
    altered(good, path, tensors=saved["tensors"], settings=json.dumps(settings))
    trainer, _ = load_checkpoint(path)
    assert (trainer.steps, trainer.settings.average_share) == (60, 0.0)


def test_tensors_that_training_would_stumble_over_are_refused(good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    tensors = torch.load(path, weights_only=True)["tensors"]
    moments = tensors["optimiser"]["state"][0]
    wrong = {
        "optimiser": tensors["optimiser"]
        | {"state": {0: moments | {"exp_avg": torch.zeros(99)}, 1: moments}},
        "actor": tensors["actor"] | {"head.bias": torch.full((2,), torch.nan)},
        "pause": tensors["pause"] | {"best": {"theta": torch.zeros(1)}},
    }
    for name, value in wrong.items():
        altered(good, path, tensors=tensors | {name: value})
        with pytest.raises(TrainingError):
            load_checkpoint(path)


def test_the_optimiser_keeps_its_own_settings(good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    tensors = torch.load(path, weights_only=True)["tensors"]
    for group in tensors["optimiser"]["param_groups"]:
        group |= {"amsgrad": True, "eps": 1e300, "betas": [9.0, 9.0]}
    altered(good, path, tensors=tensors)
    load_checkpoint(path)[0].train()


def test_an_episode_that_goes_on_after_its_end_is_refused(good: bytes, tmp_path: Path) -> None:
    """Episodes of Match-v0 have 20 steps: a million actions are not played."""
    path = tmp_path / "run.checkpoint"
    path.write_bytes(good)
    values = json.loads(torch.load(path, weights_only=True)["plain"])
    values["collector"]["walks"][0][1] = [0] * 1_000_000
    altered(good, path, plain=json.dumps(values))
    with pytest.raises(TrainingError, match="ends before its last action"):
        load_checkpoint(path)
