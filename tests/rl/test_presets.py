"""Preset files: their contents, inheritance between tables, and refusals."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import get_args

import pytest
from version_0_1_0 import of_version_0_1_0

from qcompile.device import load_device
from qcompile.errors import TrainingError
from qcompile.rl.presets import PRESETS, read_preset
from qcompile.rl.settings import Model, Settings

OF_VERSION_0_1_0 = "1b8685fbcbc89ae896f34b7310e144af2fc3cf42c1d263e82c8a222e8ea80dcf"
"""SHA-256 of the paper's values as version 0.1.0 had them in its code: trainings stand on them."""


def test_the_preset_paper_is_that_of_version_0_1_0() -> None:
    values = {
        "paper": {
            model: {name: of_version_0_1_0(settings) for name, settings in family.items()}
            for model, family in PRESETS["paper"].items()
        }
    }
    text = json.dumps(values, sort_keys=True)
    assert hashlib.sha256(text.encode()).hexdigest() == OF_VERSION_0_1_0


def test_every_model_has_both_presets_and_circuits_a_third() -> None:
    models = set(get_args(Model))
    assert {name: set(family) for name, family in PRESETS.items()} == {
        "hardware": {"svqc"},
        "paper": models,
        "tuned": models,
    }
    for family in (*PRESETS["tuned"].values(), *PRESETS["hardware"].values()):
        assert {"", "CartPole", "Acrobot", "LunarLander"} <= set(family)


@pytest.mark.parametrize("environment", ["", "CartPole", "Acrobot", "LunarLander"])
def test_the_preset_hardware_holds_and_learns_under_noise(environment: str) -> None:
    settings = PRESETS["hardware"]["svqc"][environment]
    assert settings.hold > 1
    assert settings.shots is not None
    assert not load_device(settings.backend).is_ideal
    assert settings.mitigation == "readout"


INHERITING = """
[svqc.any]
episodes = 7
critic_hidden = [8]
pause_at = 1.0
[svqc.CartPole]
like = "svqc.any"
reuse = 3
critic_hidden = "none"
[svqc."CartPole single"]
like = "svqc.CartPole"
layout = "single"
[surrogate]
like = "svqc"
every = {pause_at = "none"}
Pong = {episodes = 9, pause_at = 2.0}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_tables_inherit_from_those_above(tmp_path: Path) -> None:
    svqc = {
        "": Settings(episodes=7, critic_hidden=(8,), pause_at=1.0),
        "CartPole": Settings(episodes=7, reuse=3, pause_at=1.0),
        "CartPole single": Settings(episodes=7, reuse=3, pause_at=1.0, layout="single"),
    }
    surrogate = {
        "": Settings(model="surrogate", episodes=7, critic_hidden=(8,)),
        "CartPole": Settings(model="surrogate", episodes=7, reuse=3),
        "Pong": Settings(model="surrogate", episodes=9),
    }
    assert read_preset(written(tmp_path, INHERITING)) == {"svqc": svqc, "surrogate": surrogate}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[svqc", r"mine\.toml is not a preset\.\n  It is not TOML: "),
        ("svqc = 3", r"mine\.toml is not a preset\.\n  svqc: .*\(found 3\)"),
        ("[svqc.any]\nclipp = 1", r"\[svqc\.any\] does not hold valid settings\.\n.*\n  clipp: "),
        ("[svqc.any]\nepisodes = 0", r"\[svqc\.any\].*\n.*\n  episodes: input should be greater"),
        ("[svqc.any]\nreuse = 2", r"\[svqc\.any\] does not.*\n  The training has no end\."),
        ("[gnn.any]\nepisodes = 1", r"\[gnn\.any\] does not hold valid settings\.\n.*\n  model: "),
        ("[svqc.any]\nlike = 'fcn.any'", r"\[svqc\.any\] is like 'fcn\.any', but there is no"),
        ("[surrogate]\nlike = 'svqc'", r"\[surrogate\] is like 'svqc', but there is no such table"),
        ("[svqc.Pong]\nepisodes = 1", r"mine\.toml has no table \[svqc\.any\]\."),
    ],
)
def test_what_holds_no_settings_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(TrainingError, match=words):
        read_preset(written(tmp_path, text))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"mine\.toml is not a preset\.\n  No such file"):
        read_preset(tmp_path / "mine.toml")
