"""The paper's classical baselines: a fully connected and a convolutional network."""

from __future__ import annotations

import itertools
from typing import Any

import torch

from qcompile.errors import TrainingError
from qcompile.policy import Convolution, Dense, Network
from qcompile.policy.network import WIDTH, Layer
from qcompile.rl.models.circuits import numbers
from qcompile.rl.settings import Settings

_ACTIVATIONS = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}
_NAMES = {module: name for name, module in _ACTIVATIONS.items()}


class NetworkModel(torch.nn.Sequential):
    """Layers from observations (B, features), in any precision, to outputs (B, outputs)."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        inputs = observations.to(next(self.parameters()).dtype)
        outputs: torch.Tensor = super().forward(inputs)  # type: ignore[no-untyped-call]
        return outputs

    def policy(self, name: str, environment: str, metadata: dict[str, Any]) -> Network:
        """The policy to play, with the parameters in double precision."""
        return Network(name, environment, self._layers(), metadata=metadata)

    def take(self, network: Network) -> None:
        """Start from the parameters of a network with the same layers.

        Raises:
            TrainingError: its layers differ, or it normalises observations.
        """
        if network.mean is not None or network.std is not None:
            raise TrainingError(
                f"{network.name} has its own normalisation of observations.",
                "Start from a network without one, or resume a checkpoint.",
            )
        expected, given = ([*map(_form, layers)] for layers in (self._layers(), network.layers))
        if expected != given:
            raise TrainingError(
                f"The layers of {network.name} are {'; '.join(given)}.",
                f"The trained model has {'; '.join(expected)}.",
            )
        parts = [part for part in self if isinstance(part, torch.nn.Linear | torch.nn.Conv1d)]
        with torch.no_grad():
            for part, layer in zip(parts, network.layers, strict=True):
                assert part.bias is not None
                part.weight.copy_(torch.from_numpy(layer.weights))
                part.bias.copy_(torch.from_numpy(layer.bias))

    def _layers(self) -> list[Layer]:
        layers: list[Layer] = []
        for part, following in itertools.pairwise([*self, None]):
            if isinstance(part, torch.nn.Linear | torch.nn.Conv1d):
                assert part.bias is not None
                form = Dense if isinstance(part, torch.nn.Linear) else Convolution
                activation = _NAMES.get(type(following), "none")
                layers.append(form(numbers(part.weight), numbers(part.bias), activation))
        return layers


def settings_of(network: Network) -> dict[str, Any]:
    """The settings of a network: its hidden layers and activation."""
    *hidden, _ = network.layers
    names = {layer.activation for layer in hidden}
    if len(names) > 1 or not names <= set(_ACTIVATIONS):
        raise TrainingError(
            f"The layers of {network.name} have the activations {', '.join(sorted(names))}.",
            "A trainable network has only one, relu or tanh.",
        )
    settings: dict[str, Any] = {"hidden": tuple(len(layer.bias) for layer in hidden)}
    return settings | ({"activation": names.pop()} if names else {})


def _form(layer: Layer) -> str:
    """A layer's type and sizes in words."""
    return layer.words + ("" if layer.activation == "none" else f" ({layer.activation})")


def fully_connected(
    features: int, outputs: int, settings: Settings, generator: torch.Generator
) -> NetworkModel:
    """Linear layers of sizes `hidden` with activations, and a linear output layer."""
    sizes = [features, *settings.hidden]
    layers: list[torch.nn.Module] = []
    for before, after in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(before, after), _ACTIVATIONS[settings.activation]()]
    layers.append(torch.nn.Linear(sizes[-1], outputs))
    return _initialised(NetworkModel(*layers), settings, generator)


def convolutional(
    features: int, outputs: int, settings: Settings, generator: torch.Generator
) -> NetworkModel:
    """Convolutions of width 3 over the features, `hidden` channels, and a linear output layer."""
    channels = [1, *settings.hidden]
    layers: list[torch.nn.Module] = [torch.nn.Unflatten(1, (1, features))]
    for before, after in itertools.pairwise(channels):
        layers += [
            torch.nn.Conv1d(before, after, WIDTH, padding="same"),
            _ACTIVATIONS[settings.activation](),
        ]
    layers += [torch.nn.Flatten(), torch.nn.Linear(channels[-1] * features, outputs)]
    return _initialised(NetworkModel(*layers), settings, generator)


def _initialised(
    network: NetworkModel, settings: Settings, generator: torch.Generator
) -> NetworkModel:
    """The network with torch's default initial parameters, drawn from `generator`."""
    for layer in network:
        if isinstance(layer, (torch.nn.Linear, torch.nn.Conv1d)):
            limit = layer.weight[0].numel() ** -0.5
            for tensor in (layer.weight, layer.bias):
                assert tensor is not None
                torch.nn.init.uniform_(tensor, -limit, limit, generator)
    if settings.weight_spread is not None:
        last = network[-1]
        assert isinstance(last, torch.nn.Linear)
        torch.nn.init.normal_(last.weight, 0.0, settings.weight_spread, generator)
        torch.nn.init.zeros_(last.bias)
    return network
