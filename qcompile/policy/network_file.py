"""The schema of network files, format qcompile-network-1. See docs/reference/policies.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue

from qcompile.arrays import FloatArray
from qcompile.errors import PolicyError
from qcompile.policy.arguments import check_arguments
from qcompile.policy.blocks import Number
from qcompile.policy.decision import MOST_HELD, hold_values
from qcompile.policy.network import WIDTH, Convolution, Dense, Layer, Network
from qcompile.validation import FirstFault, Line

NETWORK_1: Literal["qcompile-network-1"] = "qcompile-network-1"

MOST_LAYERS = 100

_Numbers = Annotated[list[Number], Field(min_length=1), FirstFault()]
_Rows = Annotated[list[_Numbers], Field(min_length=1), FirstFault()]
_Kernel = Annotated[list[Number], Field(min_length=WIDTH, max_length=WIDTH), FirstFault()]
_Kernels = Annotated[
    list[Annotated[list[_Kernel], Field(min_length=1), FirstFault()]],
    Field(min_length=1),
    FirstFault(),
]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class _Layer(_Part):
    bias: _Numbers
    activation: Literal["relu", "tanh", "none"] = "none"


class DenseFile(_Layer):
    """A dense layer: `weights` has a row per output."""

    type: Literal["dense"]
    weights: _Rows

    def layer(self) -> Layer:
        """The layer that this describes."""
        return Dense(_array(self.weights), np.array(self.bias, dtype=float), self.activation)


class ConvolutionFile(_Layer):
    """A convolution of width 3: `weights` has three numbers per output and input."""

    type: Literal["convolution"]
    weights: _Kernels

    def layer(self) -> Layer:
        """The layer that this describes."""
        return Convolution(_array(self.weights), np.array(self.bias, dtype=float), self.activation)


_AnyLayer = Annotated[DenseFile | ConvolutionFile, Field(discriminator="type")]


class NetworkFile(_Part):
    """A network file."""

    format: Literal["qcompile-network-1"]
    name: Line
    environment: Line
    layers: Annotated[list[_AnyLayer], Field(min_length=1, max_length=MOST_LAYERS), FirstFault()]
    mean: _Numbers | None = None
    std: _Numbers | None = None
    metadata: dict[str, JsonValue] = {}
    hold: Annotated[int, Field(ge=1, le=MOST_HELD)] = 1
    environment_kwargs: Annotated[dict[str, JsonValue], AfterValidator(check_arguments)] = {}

    def policy(self) -> Network:
        """The network this file describes.

        Raises:
            PolicyError: its parts do not fit each other.
        """
        layers = []
        for index, part in enumerate(self.layers):
            try:
                layers.append(part.layer())
            except PolicyError as error:
                raise PolicyError(f"layers.{index}.{error}") from error
        return Network(
            self.name,
            self.environment,
            layers,
            None if self.mean is None else np.array(self.mean, dtype=float),
            None if self.std is None else np.array(self.std, dtype=float),
            self.metadata,
            self.environment_kwargs,
            self.hold,
        )


def network_values(network: Network) -> dict[str, Any]:
    """The plain values of a network file, which its schema reads back as an equal network."""
    layers = [
        {
            "type": "dense" if isinstance(layer, Dense) else "convolution",
            "weights": layer.weights.tolist(),
            "bias": layer.bias.tolist(),
            "activation": layer.activation,
        }
        for layer in network.layers
    ]
    values: dict[str, Any] = {
        "format": NETWORK_1,
        "name": network.name,
        "environment": network.environment,
        "layers": layers,
    }
    for key, array in (("mean", network.mean), ("std", network.std)):
        if array is not None:
            values[key] = array.tolist()
    values |= {"metadata": dict(network.metadata), **hold_values(network.hold)}
    if network.environment_kwargs:
        values["environment_kwargs"] = dict(network.environment_kwargs)
    return values


def _array(weights: Sequence[Sequence[Any]]) -> FloatArray:
    """Weights as an array.

    Raises:
        PolicyError: its rows have different lengths.
    """
    if len({len(row) for row in weights}) > 1:
        raise PolicyError("weights has rows of different lengths.")
    return np.array(weights, dtype=float)
