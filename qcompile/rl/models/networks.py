"""The paper's classical baselines: a fully connected and a convolutional network."""

from __future__ import annotations

import itertools

import torch

from qcompile.rl.settings import Settings

_ACTIVATIONS = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}
_KERNEL = 3


class Network(torch.nn.Sequential):
    """Layers from observations (B, features), in any precision, to outputs (B, outputs)."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        inputs = observations.to(next(self.parameters()).dtype)
        outputs: torch.Tensor = super().forward(inputs)  # type: ignore[no-untyped-call]
        return outputs


def fully_connected(
    features: int, outputs: int, settings: Settings, generator: torch.Generator
) -> Network:
    """Linear layers of the sizes `hidden`, the activation between them, and a linear output."""
    sizes = [features, *settings.hidden]
    layers: list[torch.nn.Module] = []
    for before, after in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(before, after), _ACTIVATIONS[settings.activation]()]
    layers.append(torch.nn.Linear(sizes[-1], outputs))
    return _drawn(Network(*layers), settings, generator)


def convolutional(
    features: int, outputs: int, settings: Settings, generator: torch.Generator
) -> Network:
    """Convolutions of width 3 over the row of features, `hidden` channels, and a linear output."""
    channels = [1, *settings.hidden]
    layers: list[torch.nn.Module] = [torch.nn.Unflatten(1, (1, features))]
    for before, after in itertools.pairwise(channels):
        layers += [
            torch.nn.Conv1d(before, after, _KERNEL, padding="same"),
            _ACTIVATIONS[settings.activation](),
        ]
    layers += [torch.nn.Flatten(), torch.nn.Linear(channels[-1] * features, outputs)]
    return _drawn(Network(*layers), settings, generator)


def _drawn(network: Network, settings: Settings, generator: torch.Generator) -> Network:
    """The network with torch's usual first numbers, from `generator`: uniform, 1 / sqrt(inputs)."""
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
