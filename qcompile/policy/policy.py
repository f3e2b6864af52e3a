"""Policies: an encoder, a program and a head, from observations to actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import PolicyError
from qcompile.ir import Program

ENCODINGS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "arctan": np.arctan,
    "tanh": np.tanh,
    "identity": np.asarray,
}
"""The functions an encoder can apply to a scaled feature."""

MOST_SCALE = 1e9


@dataclass(frozen=True, eq=False)
class Encoder:
    """x_i = function(scale_i * observation[feature_i]), in radians."""

    function: str
    feature: IntArray
    scale: FloatArray

    @cached_property
    def features(self) -> int:
        """The least number of features that an observation must have."""
        return int(self.feature.max(initial=-1)) + 1

    def __call__(self, observations: FloatArray) -> FloatArray:
        """Observations (B, features) to inputs x (B, inputs)."""
        return ENCODINGS[self.function](observations.take(self.feature, axis=1) * self.scale)


@dataclass(frozen=True, eq=False)
class Policy:
    """What is deployed: k actions from n circuits.

    theta (parameters,); weights (k, reuse * n), the columns ordered copy by copy; bias (k,). The
    action probabilities are softmax(weights y + bias), y the `<Z>` of the circuits, `reuse` times.
    `metadata` says where the policy comes from.

    Raises:
        PolicyError: the shapes do not fit each other, or a number is not finite.
    """

    name: str
    environment: str
    encoder: Encoder
    program: Program
    theta: FloatArray
    weights: FloatArray
    bias: FloatArray
    reuse: int = 1
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        actions, circuits = len(self.bias), len(self.program)
        needed = {
            "encoder.scale": (self.encoder.scale, (len(self.program.inputs),)),
            "encoder.feature": (self.encoder.feature, (len(self.program.inputs),)),
            "theta": (self.theta, (len(self.program.parameters),)),
            "bias": (self.bias, (actions,)),
            "weights": (self.weights, (actions, self.reuse * circuits)),
        }
        for name, (array, shape) in needed.items():
            if np.shape(array) != shape:
                raise PolicyError(f"{name} has shape {np.shape(array)}.", f"It needs {shape}.")
            if not np.isfinite(array).all():
                raise PolicyError(f"{name} holds a number that is not finite.")
        if np.abs(self.encoder.scale).max(initial=0.0) > MOST_SCALE:
            raise PolicyError(
                f"encoder.scale has an entry of {np.abs(self.encoder.scale).max():.3g}.",
                f"Scales lie within {MOST_SCALE:.0e}: more turns every angle into noise.",
            )
        if self.encoder.function not in ENCODINGS:
            raise PolicyError(
                f"Unknown encoder function {self.encoder.function!r}.",
                f"Known: {', '.join(ENCODINGS)}.",
            )
        if not circuits or not actions:
            raise PolicyError(f"The policy has {circuits} circuits and {actions} actions.")

    @property
    def actions(self) -> int:
        return len(self.bias)

    @property
    def parameter_count(self) -> int:
        """Numbers of the policy after folding: theta, input scales unless all 1, weights, bias."""
        scales = 0 if (self.encoder.scale == 1).all() else self.encoder.scale.size
        return self.theta.size + scales + self.actions * (len(self.program) + 1)

    @cached_property
    def trained_program(self) -> Program:
        """The program with the numbers of theta put in: what is left open are the inputs."""
        values = zip(self.program.parameters, self.theta.tolist(), strict=True)
        return self.program.substitute(dict(values))

    def encode(self, observations: FloatArray) -> FloatArray:
        """Observations (B, features) to inputs x (B, inputs), in radians.

        Raises:
            PolicyError: the observations have too few features.
        """
        observations = np.asarray(observations, dtype=float)
        needed = self.encoder.features
        if observations.ndim != 2 or observations.shape[1] < needed:
            raise PolicyError(
                f"Observations have shape {observations.shape}.",
                f"Policy {self.name!r} needs (B, {needed}) or wider.",
            )
        return self.encoder(observations)

    def folded(self) -> Policy:
        """The same policy without output reuse: the weights of a circuit's copies are summed."""
        return replace(self, weights=self._folded_weights, reuse=1)

    @cached_property
    def _folded_weights(self) -> FloatArray:
        return np.asarray(self.weights.reshape(self.actions, self.reuse, -1).sum(axis=1))

    @cached_property
    def importance(self) -> FloatArray:
        """How much an error of a circuit's `<Z>` matters: the variance of its weights over actions.

        (circuits,). An error dz of `<Z>` moves the logits by W dz, W the folded weights. What all
        actions share of it changes no probability: the Kullback-Leibler divergence of the softmax
        before from that after is, to second order, half the variance over actions of W dz. Taken
        with all actions equally likely, and for errors that are independent and zero on average,
        it is half the sum over circuits of importance times the mean of dz^2. Errors of qubits
        have a bias too; the sum then is what it would be if their signs were random.
        """
        return np.asarray(self._folded_weights.var(axis=0))

    def logits(self, z: FloatArray) -> FloatArray:
        """`<Z>` (B, circuits) to the logarithms of the action probabilities, plus a constant."""
        return np.asarray(z @ self._folded_weights.T + self.bias)

    def probabilities(self, z: FloatArray) -> FloatArray:
        """`<Z>` (B, circuits) to action probabilities (B, actions)."""
        logits = self.logits(z)
        odds = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(odds / odds.sum(axis=1, keepdims=True))

    def sample(self, z: FloatArray, rng: np.random.Generator) -> IntArray:
        """One action for each row of `<Z>` (B, circuits), drawn from its exact probabilities."""
        return draw_actions(self.logits(z), rng)

    def greedy(self, z: FloatArray) -> IntArray:
        """The most probable action for each row of `<Z>` (B, circuits)."""
        return np.asarray(self.logits(z).argmax(axis=1))


def draw_actions(logits: FloatArray, rng: np.random.Generator) -> IntArray:
    """One action for each row of logits (B, actions), distributed as their softmax.

    The largest of logits plus Gumbel noise is distributed so.
    """
    return np.asarray((logits + rng.gumbel(size=logits.shape)).argmax(axis=1))
