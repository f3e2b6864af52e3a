"""What can be trained: modules from observations (B, features) to outputs (B, outputs)."""

from __future__ import annotations

import itertools
from dataclasses import replace

import torch

from qcompile.rl.models.head import ReusedLinear
from qcompile.rl.models.mvqc import MVQC
from qcompile.rl.models.networks import NetworkModel, convolutional, fully_connected
from qcompile.rl.models.surrogate import SurrogateModel
from qcompile.rl.models.svqc import SVQC
from qcompile.rl.settings import Settings

__all__ = [
    "MVQC",
    "SVQC",
    "NetworkModel",
    "SurrogateModel",
    "critic_size",
    "make_critic",
    "make_model",
    "model_size",
    "parameter_count",
]

_MAKERS = {
    "svqc": SVQC,
    "mvqc": MVQC,
    "surrogate": SurrogateModel,
    "fcn": fully_connected,
    "cnn": convolutional,
}

_FIRST_VALUE_SPREAD = 0.01


def make_model(
    settings: Settings, features: int, outputs: int, generator: torch.Generator
) -> torch.nn.Module:
    """The model that the settings name; its first numbers are drawn from `generator`.

    Raises:
        TrainingError: the model cannot have this shape.
    """
    return _MAKERS[settings.model](features, outputs, settings, generator)


def make_critic(settings: Settings, features: int, generator: torch.Generator) -> torch.nn.Module:
    """The model of the value, with one output: the policy's kind, or `critic_hidden`'s network.

    The network's last layer is drawn small, so that its first values are near 0.

    Raises:
        TrainingError: the model cannot have this shape.
    """
    if settings.critic_hidden is None:
        return make_model(settings, features, 1, generator)
    return fully_connected(features, 1, _critic_settings(settings), generator)


def _critic_settings(settings: Settings) -> Settings:
    assert settings.critic_hidden is not None
    return replace(
        settings,
        model="fcn",
        hidden=settings.critic_hidden,
        activation="tanh",
        weight_spread=_FIRST_VALUE_SPREAD,
    )


def model_size(settings: Settings, features: int, outputs: int) -> int:
    """How many numbers the state of `make_model` has, told without making it."""
    copies = len(settings.scales)
    if settings.model in ("fcn", "cnn"):
        first, kernel, values = (features, 1, 1) if settings.model == "fcn" else (1, 3, features)
        sizes = [first, *settings.hidden]
        hidden = sum((kernel * a + 1) * b for a, b in itertools.pairwise(sizes))
        return hidden + (sizes[-1] * values + 1) * outputs
    inputs = 3 * copies if settings.layout == "single" else features * copies
    theta, values = {
        "svqc parallel": (inputs, inputs),
        "svqc serial": (inputs, features),
        "svqc single": (copies, copies),
        "mvqc parallel": (2 * features * (copies + 1), features),
        "surrogate parallel": (0, 2 * inputs),
    }[f"{settings.model} {settings.layout}"]
    return inputs + theta + (values * settings.reuse + 1) * outputs


def critic_size(settings: Settings, features: int) -> int:
    """How many numbers the state of `make_critic` has, told without making it."""
    if settings.critic_hidden is None:
        return model_size(settings, features, 1)
    return model_size(_critic_settings(settings), features, 1)


def parameter_count(model: torch.nn.Module) -> int:
    """The numbers that are trained. Copies of output reuse are folded, as in a deployed policy."""
    trained = sum(p.numel() for p in model.parameters() if p.requires_grad)
    heads = [part for part in model.modules() if isinstance(part, ReusedLinear)]
    copies = sum(head.weights.numel() * (head.reuse - 1) // head.reuse for head in heads)
    return trained - copies
