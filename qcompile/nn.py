"""Programs as layers of torch networks."""

from __future__ import annotations

import math
from typing import Any

import torch

from qcompile.errors import CircuitError
from qcompile.foreign import describe, program_hint
from qcompile.ir import Program
from qcompile.states.statevector import Statevectors

__all__ = ["CircuitLayer"]


class CircuitLayer(torch.nn.Module):
    """A program as a layer: its inputs to `<O>` of its observables, with exact gradients.

    `theta` (parameters,) is trained, and is in the state_dict. It starts as given, by default
    uniform in [-pi, pi). The layer computes in its dtype, float32 unless `.double()` or `.to` says
    otherwise, on the CPU, without noise and without shots. Gradients of circuits of several qubits
    cannot be differentiated again.

    Raises:
        CircuitError: `program` is not a Program, it is fused, a circuit is too wide, or theta has
            another shape.
    """

    def __init__(self, program: Program, theta: torch.Tensor | None = None):
        super().__init__()
        if not isinstance(program, Program):
            raise CircuitError(
                f"CircuitLayer takes a Program, found {describe(program)}.", program_hint(program)
            )
        self.program = program
        count = len(program.parameters)
        if theta is None:
            theta = math.pi * (2 * torch.rand(count) - 1)
        if tuple(theta.shape) != (count,):
            raise CircuitError(
                f"theta has shape {tuple(theta.shape)}.", f"The program needs ({count},)."
            )
        self.theta = torch.nn.Parameter(theta.detach().clone())
        self._states: Statevectors | None = None

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """`<O>` (..., observables) for inputs x (..., inputs), in radians.

        Raises:
            CircuitError: x has another number of inputs.
        """
        count = len(self.program.inputs)
        if x.ndim < 1 or x.shape[-1] != count:
            raise CircuitError(
                f"x has shape {tuple(x.shape)}.", f"The last axis must be the {count} inputs."
            )
        dtype = self.theta.dtype
        if self._states is None or self._states.dtype != dtype:
            self._states = Statevectors(self.program, dtype)
        rows = x.to(dtype).reshape(math.prod(x.shape[:-1]), count)
        found = self._states(rows, self.theta)
        return found.reshape(*x.shape[:-1], found.shape[1])

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_states": None}  # built again where it is needed

    def extra_repr(self) -> str:
        return repr(self.program)
