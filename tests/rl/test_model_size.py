"""The size of a model, predicted before it is made, is correct."""

from __future__ import annotations

from typing import Any, get_args

import pytest
import torch

from qcompile.rl.models import critic_size, make_critic, make_model, model_size
from qcompile.rl.settings import Model, Settings

SETTINGS: list[dict[str, Any]] = [
    *({"model": model} for model in get_args(Model)),
    {"scales": ((1.0, 2.0, 3.0, 4.0), 2.0), "reuse": 5},
    {"layout": "serial", "scales": (1.0, 2.0, 3.0), "trainable_scale": True},
    {"layout": "single", "scales": (1.0, 2.0), "reuse": 2},
    {"model": "mvqc", "scales": (1.0, 2.0, 3.0), "reuse": 4},
    {"model": "surrogate", "scales": (1.0, 2.0), "reuse": 3},
    {"model": "fcn", "hidden": (7,), "critic_hidden": (5, 6)},
    {"model": "cnn", "hidden": (3, 2, 5), "critic_hidden": (4,)},
    {"critic_hidden": (8, 9)},
]


@pytest.mark.parametrize("changes", SETTINGS, ids=str)
def test_a_size_is_told_before_the_model_is_made(changes: dict[str, Any]) -> None:
    settings, generator = Settings(episodes=1, **changes), torch.Generator()
    for features, outputs in ((4, 2), (5, 3)):
        if changes.get("scales", (1.0,))[0] != 1.0 and features != 4:
            continue
        actor = make_model(settings, features, outputs, generator)
        critic = make_critic(settings, features, generator)
        assert numbers(actor) == model_size(settings, features, outputs)
        assert numbers(critic) == critic_size(settings, features)


def numbers(model: torch.nn.Module) -> int:
    return sum(tensor.numel() for tensor in model.state_dict().values())
