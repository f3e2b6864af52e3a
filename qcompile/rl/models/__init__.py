"""The models that can be trained: modules from observations (B, features) to outputs."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import torch

from qcompile.caller import option
from qcompile.errors import TrainingError
from qcompile.policy import Ansatz
from qcompile.rl.models.circuits import CircuitModel
from qcompile.rl.models.networks import NetworkModel, convolutional, fully_connected, settings_of
from qcompile.rl.models.surrogate import SurrogateModel
from qcompile.rl.settings import Settings

__all__ = [
    "CircuitModel",
    "Model",
    "NetworkModel",
    "SurrogateModel",
    "critic_size",
    "make_critic",
    "make_model",
    "model_of",
    "model_size",
    "settings_of",
]

Model = CircuitModel | SurrogateModel | NetworkModel

_MAKERS: dict[str, Callable[[int, int, Settings, torch.Generator], Model]] = {
    "svqc": CircuitModel,
    "mvqc": CircuitModel,
    "surrogate": SurrogateModel,
    "fcn": fully_connected,
    "cnn": convolutional,
}

_FIRST_VALUE_SPREAD = 0.01


def make_model(
    settings: Settings,
    features: int,
    outputs: int,
    generator: torch.Generator,
    ansatz: Ansatz | None = None,
) -> Model:
    """The model named in the settings, with the circuits of `ansatz` if there is one.

    Its initial parameters are drawn from `generator`, except those given with the circuits.

    Raises:
        TrainingError: the model cannot have this shape.
    """
    if ansatz is None:
        return _MAKERS[settings.model](features, outputs, settings, generator)
    if settings.model != (own := model_of(ansatz)):
        raise TrainingError(
            f"Model {settings.model!r} cannot train {ansatz.origin}.", f"Train it as {own}."
        )
    if ansatz.bias is not None and len(ansatz.bias) != outputs:
        raise TrainingError(
            f"{ansatz.origin} has {len(ansatz.bias)} actions; the environment has {outputs}.",
            f"{option('circuits')} takes only its circuits and their parameters, with a new head.",
        )
    return CircuitModel(features, outputs, settings, generator, ansatz)


def model_of(ansatz: Ansatz) -> str:
    """The name of the model that trains own circuits: mvqc if one has several qubits."""
    return "mvqc" if ansatz.program.is_wide else "svqc"


def make_critic(
    settings: Settings, features: int, generator: torch.Generator, ansatz: Ansatz | None = None
) -> Model:
    """The value model with one output: of the policy's kind, or the network of `critic_hidden`.

    The network's last layer starts small, so that its initial values are near 0. With own circuits
    it starts from random parameters.

    Raises:
        TrainingError: the model cannot have this shape.
    """
    if settings.critic_hidden is None:
        circuits = None if ansatz is None else ansatz.without_numbers
        return make_model(settings, features, 1, generator, circuits)
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


def model_size(
    settings: Settings, features: int, outputs: int, ansatz: Ansatz | None = None
) -> int:
    """The number of values in the state of `make_model`, without making it."""
    copies = len(settings.scales)
    if settings.model in ("fcn", "cnn"):
        first, kernel, values = (features, 1, 1) if settings.model == "fcn" else (1, 3, features)
        sizes = [first, *settings.hidden]
        hidden = sum((kernel * a + 1) * b for a, b in itertools.pairwise(sizes))
        return hidden + (sizes[-1] * values + 1) * outputs
    if settings.features is not None:
        features = len(settings.features)
    inputs = 3 * copies if settings.layout == "single" else features * copies
    if ansatz is not None:
        inputs = len(ansatz.inputs)
        theta, values = len(ansatz.parameters), len(ansatz.program.measured)
    else:
        theta, values = {
            "svqc parallel": (inputs, inputs),
            "svqc serial": (inputs, features),
            "svqc single": (copies, copies),
            "mvqc parallel": (2 * features * (copies + 1), features),
            "surrogate parallel": (0, 2 * inputs),
        }[f"{settings.model} {settings.layout}"]
    encoder = inputs * (1 + settings.trainable_gain)
    return encoder + theta + (values * settings.reuse + 1) * outputs


def critic_size(settings: Settings, features: int, ansatz: Ansatz | None = None) -> int:
    """The number of values in the state of `make_critic`, without making it."""
    if settings.critic_hidden is None:
        return model_size(settings, features, 1, ansatz)
    return model_size(_critic_settings(settings), features, 1)
