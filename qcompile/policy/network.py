"""Networks: policies of dense and convolutional layers, without circuits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import PolicyError
from qcompile.notebook import count, html_table
from qcompile.policy.decision import (
    Softmax,
    check_hold,
    check_names,
    checked_observations,
    hold_text,
)
from qcompile.policy.encoder import check_arrays

WIDTH = 3
"""The width of a convolution, in features."""

MOST_UNITS = 100_000
"""The most outputs of a layer for one observation."""


def _relu(values: FloatArray) -> FloatArray:
    return np.maximum(values, 0.0)


ACTIVATIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "relu": _relu,
    "tanh": np.tanh,
    "none": np.asarray,
}
"""The activation functions of a layer."""


@dataclass(frozen=True, eq=False)
class Dense:
    """activation(weights values + bias): weights (outputs, inputs), bias (outputs,).

    Its inputs are all outputs of the previous layer, for a convolution channel by channel.
    """

    weights: FloatArray
    bias: FloatArray
    activation: str = "none"

    def __call__(self, values: FloatArray) -> FloatArray:
        """The outputs (B, outputs) of values (B, ...)."""
        flat = values.reshape(len(values), -1)
        return ACTIVATIONS[self.activation](flat @ self.weights.T + self.bias)

    @property
    def words(self) -> str:
        outputs, inputs = self.weights.shape
        return f"dense, {inputs} to {outputs}"


@dataclass(frozen=True, eq=False)
class Convolution:
    """A convolution of width 3 over the features: weights (outputs, inputs, 3), bias (outputs,).

    Inputs and outputs are channels. Position i of an output is activation(bias + the sum over
    inputs and k of weights[., ., k] times position i + k - 1), with zero padding.
    """

    weights: FloatArray
    bias: FloatArray
    activation: str = "none"

    def __call__(self, values: FloatArray) -> FloatArray:
        """Maps (B, inputs, features) to (B, outputs, features); (B, features) is one channel."""
        if values.ndim == 2:
            values = values[:, np.newaxis]
        padded = np.pad(values, ((0, 0), (0, 0), (1, 1)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, WIDTH, axis=2)
        sums = np.tensordot(windows, self.weights, axes=((1, 3), (1, 2)))  # (B, features, outputs)
        return ACTIVATIONS[self.activation]((sums + self.bias).swapaxes(1, 2))

    @property
    def words(self) -> str:
        outputs, inputs, width = self.weights.shape
        return f"convolution of width {width}, {inputs} to {outputs} channels"


Layer = Dense | Convolution


@dataclass(frozen=True, eq=False, repr=False)
class Network(Softmax):
    """A network policy: the last of its `layers` gives the logits of the actions.

    Convolutions come before dense layers, and the last layer is dense. `mean` and `std` (features,)
    normalise the observations first: (observation - mean) / std; the defaults are 0 and 1. The
    environment is made with the arguments `environment_kwargs`, and each decision is held for
    `hold` environment steps.

    Everything is computed in double precision. Training computes in float32 with the same
    parameters, so its logits and action probabilities differ by rounding.

    Raises:
        PolicyError: the shapes do not fit each other, a number is not finite, `hold` is not a
            number of steps, or a name is not a line of text.
    """

    name: str
    environment: str
    layers: Sequence[Layer]
    mean: FloatArray | None = None
    std: FloatArray | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)
    environment_kwargs: Mapping[str, Any] = field(default_factory=dict)
    hold: int = 1

    def __post_init__(self) -> None:
        if not self.layers or not isinstance(self.layers[-1], Dense):
            raise PolicyError("The last layer of a network must be dense: it gives the logits.")
        for index, layer in enumerate(self.layers):
            _check_layer(f"layers.{index}", layer)
        for index, (before, layer) in enumerate(pairwise(self.layers), 1):
            self._check_after(index, before, layer)
        for key, array in (("mean", self.mean), ("std", self.std)):
            check_arrays({key: (array, (self.features,))})
        if self.std is not None and not (self.std > 0).all():
            raise PolicyError("std contains a number that is not positive.")
        check_hold(self.hold)
        check_names(name=self.name, environment=self.environment)

    def _check_after(self, index: int, before: Layer, layer: Layer) -> None:
        if isinstance(layer, Convolution) and isinstance(before, Dense):
            raise PolicyError(
                f"layers.{index} is a convolution after a dense layer.",
                "Convolutions must come first: they act on neighbouring features.",
            )
        per_channel = self.features if isinstance(before, Convolution) else 1
        needed = len(before.bias) * (1 if isinstance(layer, Convolution) else per_channel)
        if layer.weights.shape[1] != needed:
            raise PolicyError(
                f"layers.{index} has {layer.weights.shape[1]} inputs.",
                f"The previous layer has {needed} outputs.",
            )
        if len(before.bias) * per_channel > MOST_UNITS:
            raise PolicyError(
                f"layers.{index - 1} has {len(before.bias) * per_channel:,} outputs.",
                f"A layer may have at most {MOST_UNITS:,}.",
            )

    @cached_property
    def features(self) -> int:
        """The number of features of an observation."""
        first = next(i for i, layer in enumerate(self.layers) if isinstance(layer, Dense))
        channels = len(self.layers[first - 1].bias) if first else 1
        return int(self.layers[first].weights.shape[1]) // channels

    @property
    def actions(self) -> int:
        return len(self.layers[-1].bias)

    @property
    def model(self) -> str:
        """The name of the model in training: cnn if it begins with a convolution, else fcn."""
        return "cnn" if isinstance(self.layers[0], Convolution) else "fcn"

    @property
    def parameter_count(self) -> int:
        """The number of parameters of all layers."""
        return sum(layer.weights.size + layer.bias.size for layer in self.layers)

    def __repr__(self) -> str:
        sizes = (count(number, noun) for noun, number in self._sizes.items())
        held = [f"hold {self.hold}"] * (self.hold > 1)
        return f"Network({', '.join([self.name, self.environment, *sizes, *held])})"

    def _repr_html_(self) -> str:
        rows = [["environment", self.environment]]
        rows += [[f"{noun}s", f"{number:,}"] for noun, number in self._sizes.items()]
        rows += [["decision", hold_text(self.hold)]] * (self.hold > 1)
        return html_table(["network", self.name], rows)

    @property
    def _sizes(self) -> dict[str, int]:
        parameters = self.parameter_count
        return {"layer": len(self.layers), "parameter": parameters, "action": self.actions}

    def logits(self, observations: FloatArray, /) -> FloatArray:
        """The logits of the actions (B, actions) for observations (B, features).

        Raises:
            PolicyError: the observations have the wrong shape, or lead to infinite or NaN logits.
        """
        reader = f"Network {self.name!r}"
        values = checked_observations(observations, self.features, reader, wider=False)
        with np.errstate(over="ignore", invalid="ignore"):
            if self.mean is not None:
                values = values - self.mean
            if self.std is not None:
                values = values / self.std
            for layer in self.layers:
                values = layer(values)
        if not np.isfinite(values).all():
            raise PolicyError(f"{reader} returns logits that are not finite.")
        return values


def _check_layer(key: str, layer: Layer) -> None:
    """Raise PolicyError if the arrays of a layer do not fit each other."""
    if layer.activation not in ACTIVATIONS:
        raise PolicyError(
            f"{key}: unknown activation {layer.activation!r}.", f"Known: {', '.join(ACTIVATIONS)}."
        )
    outputs, inputs = len(layer.bias), np.shape(layer.weights)[1:2]
    shape = (outputs, *inputs, *([WIDTH] * isinstance(layer, Convolution)))
    check_arrays(
        {f"{key}.weights": (layer.weights, shape), f"{key}.bias": (layer.bias, (outputs,))}
    )
    if not layer.weights.size:
        raise PolicyError(f"{key} has no inputs or no outputs.")
