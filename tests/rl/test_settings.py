"""Settings and presets: refusals and their messages."""

from __future__ import annotations

import json
from typing import Any, get_args

import pytest
import torch

from qcompile.deploy.environments import features_and_actions, make_environments
from qcompile.errors import TrainingError
from qcompile.rl.models import make_model
from qcompile.rl.presets import PRESETS, settings_for
from qcompile.rl.settings import Model, Settings, plain, restored

BASE = Settings(steps=1, horizon=8)

COUNTS = ["reuse", "environments", "horizon", "steps", "episodes", "epochs", "minibatch", "shots"]
FRACTIONS = ["gamma", "gae_lambda"]
POSITIVE = ["actor_lr", "critic_lr", "clip", "weight_spread", "gradient_norm"]


def refused(**values: Any) -> str:
    with pytest.raises(TrainingError) as caught:
        BASE.changed(**values)
    return str(caught.value)


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("value", [0, -3])
def test_a_count_below_one_is_refused(name: str, value: int) -> None:
    rule = f"{name}: input should be greater than or equal to 1 (found {value})"
    assert rule in refused(**{name: value})


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("value", [2.5, "many", [1]])
def test_a_count_that_is_no_whole_number_is_refused(name: str, value: Any) -> None:
    assert f"{name}: input should be a valid integer" in refused(**{name: value})


@pytest.mark.parametrize("name", FRACTIONS)
@pytest.mark.parametrize(
    ("value", "rule"),
    [
        (-0.1, "greater than or equal to 0 (found -0.1)"),
        (1.1, "less than or equal to 1 (found 1.1)"),
        (float("nan"), "a finite number (found nan)"),
    ],
)
def test_a_discount_outside_its_interval_is_refused(name: str, value: float, rule: str) -> None:
    assert f"{name}: input should be {rule}" in refused(**{name: value})


@pytest.mark.parametrize("name", POSITIVE)
@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan"), "much"])
def test_a_size_that_is_not_positive_is_refused(name: str, value: Any) -> None:
    assert f"{name}: input should be " in refused(**{name: value})


@pytest.mark.parametrize("name", ["theta_spread_rad", "entropy"])
def test_zero_is_none_of_something_and_less_is_refused(name: str) -> None:
    assert getattr(BASE.changed(**{name: 0.0}), name) == 0.0
    assert f"{name}: input should be greater than or equal to 0" in refused(**{name: -1e-9})


@pytest.mark.parametrize("scales", [(), (1.0, -2.0), (0.0,), ((1.0,), ()), (float("inf"),)])
def test_scales_that_are_not_positive_are_refused(scales: tuple[Any, ...]) -> None:
    assert "scales" in refused(scales=scales)


@pytest.mark.parametrize(
    ("name", "value", "known"),
    [
        ("layout", "ring", "'parallel', 'serial', 'single' or 'own'"),
        ("model", "gnn", "'svqc', 'mvqc', 'fcn', 'cnn' or 'surrogate'"),
        ("mitigation", "magic", "'none' or 'readout'"),
        ("activation", "step", "'relu' or 'tanh'"),
    ],
)
def test_an_unknown_word_gets_the_known_ones(name: str, value: str, known: str) -> None:
    assert f"{name}: input should be {known} (found '{value}')" in refused(**{name: value})


def test_a_wrong_value_is_a_line_of_its_own() -> None:
    """First the failure, then a line per fault, not a Python list."""
    lines = refused(gamma=2, clip=-1).splitlines()
    assert len(lines) == 3
    assert lines[1:] == [
        "  gamma: input should be less than or equal to 1 (found 2)",
        "  clip: input should be greater than 0 (found -1)",
    ]


def test_an_unknown_name_gets_the_nearest() -> None:
    assert refused(actor_rl=0.1) == "Unknown setting 'actor_rl'.\n  Did you mean actor_lr?"
    assert "Unknown setting 'gama'.\n  Did you mean gamma" in refused(gama=0.9)
    assert "Known: model, layout, scales, " in refused(zzzzqq=1)


def test_settings_that_contradict_each_other_are_refused() -> None:
    assert "4 environments need a horizon" in refused(environments=4, horizon=None)
    assert "The training has no end" in refused(steps=None)
    for settings in (Settings(environments=4, steps=1), Settings()):
        with pytest.raises(TrainingError):
            settings.check()
    assert BASE.check() is BASE


@pytest.mark.parametrize(
    ("model", "name", "value"),
    [
        ("fcn", "reuse", 2),
        ("fcn", "scales", (2.0,)),
        ("cnn", "trainable_scale", True),
        ("cnn", "theta_spread_rad", 1.0),
        ("surrogate", "theta_spread_rad", 1.0),
        ("mvqc", "layout", "serial"),
        ("surrogate", "layout", "single"),
        ("surrogate", "backend", "ibm_lima"),
        ("fcn", "shots", 100),
        ("surrogate", "mitigation", "readout"),
        ("svqc", "hidden", (3,)),
        ("mvqc", "activation", "tanh"),
    ],
)
def test_a_setting_of_another_model_is_refused(model: str, name: str, value: Any) -> None:
    message = refused(model=model, **{name: value})
    assert message.startswith(f"Model '{model}' has no setting '{name}' (found {value!r}).\n  It ")


@pytest.mark.parametrize("model", get_args(Model))
def test_settings_of_every_model_come_back_from_plain_values(model: str) -> None:
    mine: dict[str, dict[str, Any]] = {
        "svqc": {"scales": (0.5, (1.0, 2.0)), "shots": 100, "backend": "ibm_lima", "reuse": 3},
        "mvqc": {"scales": (1.0, 2.0), "theta_spread_rad": 0.1},
        "surrogate": {"scales": (1.0,), "trainable_scale": True},
        "fcn": {"hidden": (3, 4), "activation": "tanh"},
        "cnn": {"hidden": (), "weight_spread": 0.01},
    }
    settings = BASE.changed(model=model, pause_at=-3.5, minibatch=7, **mine[model])
    values = json.loads(json.dumps(plain(settings)))
    assert restored(values) == settings
    assert hash(restored(values)) == hash(settings), "lists became tuples again"


@pytest.mark.parametrize(
    "values",
    [
        {"steps": 1, "gamma": 2},
        {"steps": 1, "unheard_of": 1},
        {"steps": 1, "model": "fcn", "reuse": 2},
        {},
    ],
)
def test_plain_values_that_are_no_settings_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(TrainingError):
        restored(values)


CASES = [
    (preset, model, name)
    for preset, models in PRESETS.items()
    for model, family in models.items()
    for name in family
]


@pytest.mark.parametrize(("preset", "model", "name"), CASES)
def test_every_preset_is_fit_for_its_environment(preset: str, model: str, name: str) -> None:
    settings = PRESETS[preset][model][name]
    assert settings.check() is settings
    assert settings.model == model
    versioned = {"": "MountainCar-v0", "LunarLander": "LunarLander-v3"}
    environment, *layout = name.split(" ")
    environment = versioned.get(environment, f"{environment}-v1")
    assert settings_for(preset, environment, model, *layout) == settings
    made = make_environments(environment, 1)[0]
    features, actions = features_and_actions(made)
    made.close()
    network = make_model(settings, features, actions, torch.Generator().manual_seed(0))
    assert network(torch.zeros(5, features)).shape == (5, actions)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_serves_any_environment(preset: str) -> None:
    for model, family in PRESETS[preset].items():
        assert settings_for(preset, "Unheard-v7", model) == family[""]


def test_a_layout_without_a_preset_of_its_own_changes_that_of_the_environment() -> None:
    serial = settings_for("paper", "LunarLander-v3", "svqc", "serial")
    parallel = settings_for("paper", "LunarLander-v3")
    assert serial == parallel.changed(layout="serial")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("best", "CartPole-v1"), "Unknown preset 'best'.\n  Known: hardware, paper, tuned."),
        (("paper", "CartPole-v1", "gnn"), "Preset 'paper' has no settings for model 'gnn'."),
        (
            ("paper", "CartPole-v1", "fcn", "single"),
            "Model 'fcn' has no setting 'layout' (found 'single').",
        ),
        (("paper", "CartPole-v1", "svqc", "ring"), "'parallel', 'serial', 'single' or 'own'"),
    ],
)
def test_a_preset_that_is_not_there_is_refused(arguments: tuple[str, ...], message: str) -> None:
    with pytest.raises(TrainingError) as caught:
        settings_for(*arguments)
    assert message in str(caught.value)


def test_a_shorter_training_falls_as_the_preset_does() -> None:
    """`--episodes 60` is the first 60 episodes of the preset's 150."""
    preset = settings_for("tuned", "CartPole-v1")
    assert (preset.episodes, preset.anneal_episodes, preset.anneal_steps) == (150, 150, None)
    for changes in ({"episodes": 60}, {"episodes": None, "steps": 5000}, {"episodes": 900}):
        made = preset.changed(**changes)
        assert (made.anneal_steps, made.anneal_episodes) == (None, 150)
        assert restored(plain(made)) == made
    assert preset.changed(episodes=60).changed(clip=0.3).anneal_episodes == 150
    own = preset.changed(anneal_episodes=60, episodes=60)
    assert own.anneal_episodes == 60


def test_annealing_switched_on_falls_within_the_budget_of_the_preset() -> None:
    made = settings_for("paper", "CartPole-v1").changed(anneal=True, episodes=60)
    assert made.anneal_episodes == 500
    assert made.changed(anneal=False).anneal_episodes is None


def test_settings_of_earlier_files_fall_within_their_own_budget() -> None:
    """They hold no budget to fall within: their training fell within its own."""
    values = plain(settings_for("tuned", "CartPole-v1"))
    del values["anneal_steps"], values["anneal_episodes"]
    assert restored(values) == settings_for("tuned", "CartPole-v1")
    assert restored(values | {"episodes": 60}).anneal_episodes == 60


def test_rollouts_that_a_pause_would_tear_apart_are_refused() -> None:
    whole = settings_for("paper", "LunarLander-v3").changed(rollouts=3)
    assert whole.pause_at is not None
    assert whole.changed(pause_at=None, horizon=32).rollouts == 3
    with pytest.raises(TrainingError, match="pause_at leaves gaps"):
        whole.changed(horizon=32)
