"""The model of circuits and a linear layer; circuits of one qubit are evaluated as in numpy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from qcompile.limits import MAX_KEYS
from qcompile.policy import Ansatz, Encoder, Policy
from qcompile.policy.ansatz import NO_FACTOR
from qcompile.policy.encoder import BITS
from qcompile.rl.models.head import ReusedLinear, first_theta
from qcompile.rl.models.wiring import wiring
from qcompile.rl.settings import Settings
from qcompile.states.statevector import Statevectors

_FUNCTIONS: dict[str, Callable[[torch.Tensor], torch.Tensor]] = {
    "arctan": torch.arctan,
    "tanh": torch.tanh,
    "identity": lambda values: values,
    "clip": lambda values: values.clamp(-1.0, 1.0),
    BITS: lambda values: math.pi * values,
}
"""`qcompile.policy.ENCODINGS` in torch; bit observations are vectors of bits."""


class CircuitModel(torch.nn.Module):
    """Variational circuits and a linear layer: observations to outputs.

    The circuits are those of the settings, of one qubit each (arXiv 2203.14348) or one of a qubit
    per feature (arXiv 2103.05577), or come from `ansatz`, which may set initial parameters.

    Raises:
        CircuitError, TrainingError: circuits, settings and features do not fit each other, or a
            circuit has too many qubits.
    """

    def __init__(
        self,
        features: int,
        outputs: int,
        settings: Settings,
        generator: torch.Generator,
        ansatz: Ansatz | None = None,
    ):
        super().__init__()
        wired = wiring(settings, features, ansatz)
        self.ansatz, self._encoder = wired.ansatz, wired.encoder
        self.program = self.ansatz.program
        self.feature: torch.Tensor
        self._keep("feature", wired.encoder.feature)
        self._states = Statevectors(self.program)
        self.log_scale = torch.nn.Parameter(wired.log_scale, settings.trainable_scale)
        self.theta = first_theta(settings, (len(self.program.parameters),), generator)
        self.head = ReusedLinear(len(self.program.measured), outputs, settings, generator)
        gain = torch.tensor(wired.encoder.gains, dtype=torch.float32)
        self.gain = torch.nn.Parameter(gain) if settings.trainable_gain else None
        self._start()
        self._wire()

    def _keep(self, name: str, array: np.ndarray[Any, Any] | None) -> None:
        """Set an array as an untrained buffer, or None as a plain attribute."""
        if array is None:
            setattr(self, name, None)
        else:
            self.register_buffer(name, torch.tensor(array), persistent=False)

    def _start(self) -> None:
        """Set the initial parameters given with the circuits; factors of inputs start at 1."""
        ansatz = self.ansatz
        with torch.no_grad():
            self.theta[ansatz.factors[ansatz.factors != NO_FACTOR]] = 1.0
            if ansatz.theta is not None:
                self.theta.copy_(torch.tensor(ansatz.theta))
            if ansatz.weights is not None and ansatz.bias is not None:
                self.head.start(torch.tensor(ansatz.weights), torch.tensor(ansatz.bias))

    def _wire(self) -> None:
        """Set what `inputs` needs beyond features and scales, None if unused."""
        ansatz, encoder = self.ansatz, self._encoder
        self._base: torch.Tensor | None
        self._gain: torch.Tensor | None
        self._mean: torch.Tensor | None
        self._std: torch.Tensor | None
        self._reads: torch.Tensor | None
        self._factors: torch.Tensor | None
        self._keep("_base", encoder.scale if (encoder.scale != 1).any() else None)
        self._keep("_gain", encoder.gain if self.gain is None else None)
        for name, array in (("_mean", encoder.mean), ("_std", encoder.std)):
            self._keep(name, None if array is None else array[encoder.feature])
        own = np.array_equal(ansatz.reads, np.arange(len(ansatz.inputs)))
        self._keep("_reads", None if own else ansatz.reads)
        # Inputs without a factor take the 1 that stands behind theta.
        multiplied = (ansatz.factors != NO_FACTOR).any()
        self._keep("_factors", ansatz.factors % (len(self.theta) + 1) if multiplied else None)
        names = np.array(encoder.functions)
        self._columns = [
            (_FUNCTIONS[name], torch.tensor(np.flatnonzero(names == name)))
            for name in dict.fromkeys(encoder.functions)
        ]
        self._order = torch.cat([columns for _, columns in self._columns]).argsort()

    def inputs(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to the inputs x of the circuits (B, inputs), in radians.

        Double-precision observations are encoded in double precision, as in the deployed policy.
        """
        values = observations.index_select(1, self.feature)
        if self._mean is not None:
            values = values - self._mean
        if self._std is not None:
            values = values / self._std
        scale = self.log_scale.exp()
        x = self._encoded(values * (scale if self._base is None else scale * self._base))
        gain = self._gain if self.gain is None else self.gain
        if gain is not None:
            x = x * gain
        x = x.to(self.theta.dtype)
        if self._reads is not None:
            x = x.index_select(1, self._reads)
        if self._factors is not None:
            x = x * torch.cat([self.theta, self.theta.new_ones(1)])[self._factors]
        return x

    def _encoded(self, scaled: torch.Tensor) -> torch.Tensor:
        """The functions of the scaled features (B, inputs)."""
        if len(self._columns) == 1:
            ((function, _),) = self._columns
            return function(scaled)
        parts = [function(scaled[:, columns]) for function, columns in self._columns]
        return torch.cat(parts, dim=1).index_select(1, self._order)

    def expectation(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to the ideal `<O>` of every observable (B, observables)."""
        return self._states(self.inputs(observations), self.theta)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to outputs (B, outputs)."""
        outputs: torch.Tensor = self.head(self.expectation(observations))
        return outputs

    def policy(self, name: str, environment: str, metadata: dict[str, Any]) -> Policy:
        """The policy to deploy: parameters in double precision, output reuse folded."""
        head = self.head
        return self.ansatz.policy(
            name,
            environment,
            self._trained_encoder(),
            numbers(self.theta),
            numbers(head.weights),
            numbers(head.bias),
            reuse=head.reuse,
            metadata=metadata,
        ).folded()

    def circuits_metadata(self) -> dict[str, Any]:
        """The origin of the circuits, and their trained parameters by their original names."""
        values: dict[str, Any] = {"origin": self.ansatz.origin}
        if self.ansatz.has_own_names and len(self.theta) <= MAX_KEYS:
            named = zip(self.ansatz.parameters, numbers(self.theta).tolist(), strict=True)
            values["parameters"] = dict(named)
        return values

    def _trained_encoder(self) -> Encoder:
        """The encoder of the circuits' inputs with the current parameters."""
        encoder = self._encoder
        scale = encoder.scale * numbers(self.log_scale.exp())
        gain = encoder.gain if self.gain is None else numbers(self.gain)
        if encoder.reads_bits:  # for bits, a scale acts as a gain
            factor = scale if gain is None else scale * gain
            gain, scale = (factor if (factor != 1).any() else None), np.ones(len(scale))
        return replace(encoder, scale=scale, gain=gain)


def numbers(tensor: torch.Tensor) -> np.ndarray[Any, Any]:
    """The values of a tensor in double precision."""
    return tensor.detach().double().numpy().copy()
