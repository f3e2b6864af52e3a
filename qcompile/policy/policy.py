"""Policies map observations to actions with an encoder, a program and a head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import PolicyError
from qcompile.ir import Program
from qcompile.notebook import count, html_table
from qcompile.policy.decision import (
    Softmax,
    check_hold,
    check_names,
    checked_observations,
    hold_text,
)
from qcompile.policy.encoder import Encoder, check_arrays

NO_THETA = np.zeros(0)
"""The parameters of a trained program: there are none left."""


@dataclass(frozen=True, eq=False, repr=False)
class Policy(Softmax):
    """A policy that chooses among k actions with n observables of its circuits.

    theta (parameters,); weights (k, reuse * n), with columns ordered copy by copy; bias (k,). The
    action probabilities are softmax(weights y + bias), where y is the `<Z>` of the circuits,
    repeated `reuse` times. `metadata` says where the policy comes from. Its environment is made
    with the arguments `environment_kwargs`, and each decision is held for `hold` environment steps.

    Raises:
        PolicyError: the shapes do not fit each other, a number is not finite, `hold` is out of
            range, or a name is not a line of text.
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
    hold: int = 1
    environment_kwargs: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        actions, observables = len(self.bias), len(self.program.measured)
        self.encoder.check(len(self.program.inputs))
        check_arrays(
            {
                "theta": (self.theta, (len(self.program.parameters),)),
                "bias": (self.bias, (actions,)),
                "weights": (self.weights, (actions, self.reuse * observables)),
            }
        )
        if not observables or not actions:
            raise PolicyError(f"The policy has {observables} circuits and {actions} actions.")
        check_hold(self.hold)
        check_names(name=self.name, environment=self.environment)

    @property
    def actions(self) -> int:
        return len(self.bias)

    @property
    def reads_bits(self) -> bool:  # type: ignore[override]
        """Whether an observation is one whole number whose bits are the inputs."""
        return self.encoder.reads_bits

    def __repr__(self) -> str:
        sizes = (count(number, noun) for noun, number in self._sizes.items())
        held = [f"hold {self.hold}"] * (self.hold > 1)
        return f"Policy({', '.join([self.name, self.environment, *sizes, *held])})"

    def _repr_html_(self) -> str:
        rows = [["environment", self.environment]]
        rows += [[f"{noun}s", f"{number:,}"] for noun, number in self._sizes.items()]
        rows += [["decision", hold_text(self.hold)]] * (self.hold > 1)
        return html_table(["policy", self.name], rows)

    @property
    def _sizes(self) -> dict[str, int]:
        parameters = self.parameter_count
        return {"circuit": len(self.program), "parameter": parameters, "action": self.actions}

    @property
    def parameter_count(self) -> int:
        """The parameters after folding: theta, scales and gains unless all 1, weights, bias."""
        factors = (self.encoder.scale, self.encoder.gains)
        count = sum(array.size for array in factors if (array != 1).any())
        return self.theta.size + count + self.actions * (len(self.program.measured) + 1)

    @cached_property
    def trained_program(self) -> Program:
        """The program with theta substituted; only the inputs are left."""
        values = zip(self.program.parameters, self.theta.tolist(), strict=True)
        return self.program.substitute(dict(values))

    def encode(self, observations: FloatArray) -> FloatArray:
        """The inputs x (B, inputs), in radians, of observations (B, features).

        Raises:
            PolicyError: the observations have too few features.
        """
        reader, features = f"Policy {self.name!r}", self.encoder.features
        return self.encoder(checked_observations(observations, features, reader, wider=True))

    def folded(self) -> Policy:
        """The same policy without output reuse: the weights of a circuit's copies are summed."""
        return replace(self, weights=self._folded_weights, reuse=1)

    @cached_property
    def _folded_weights(self) -> FloatArray:
        return np.asarray(self.weights.reshape(self.actions, self.reuse, -1).sum(axis=1))

    @cached_property
    def importance(self) -> FloatArray:
        """How much an error of an observable matters: the variance of its weights over actions.

        Shape (observables,): by default one for each circuit, its `<Z>`. An error dz in `<Z>`
        moves the logits by W dz, where W are the folded weights. A shift common to all actions
        changes no probability: to second order, the Kullback-Leibler divergence between the
        softmax before and after is half the variance of W dz over actions. For equally likely
        actions and independent errors of zero mean, it is half the sum over observables of
        importance times the mean of dz^2. Errors of qubits also have a bias; the sum then treats
        their signs as random.
        """
        return np.asarray(self._folded_weights.var(axis=0))

    def logits(self, z: FloatArray, /) -> FloatArray:
        """The logarithms of the action probabilities, up to a constant, for `<Z>` (B, circuits)."""
        return np.asarray(z @ self._folded_weights.T + self.bias)
