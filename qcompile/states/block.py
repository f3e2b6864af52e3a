"""One circuit of several qubits in torch: `<O>` for a batch, and its gradient.

A state is (2**width, B), or (2**width, 1) before the first layer that inputs enter: all rows share
the operators of layers, and only phases differ. The gradient walks back from the last state and
undoes layer after layer, so that no other state is kept. Source: arXiv 2009.02823 (the adjoint
method).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import CircuitError
from qcompile.ir import Angle
from qcompile.states.forms import Forms
from qcompile.states.layers import Layer
from qcompile.states.operators import Bound, Operators, groups


class Block:
    """Evaluates a circuit of several qubits, given as layers.

    `signs` (2**width, observables) are the values of the observables in each basis state.
    """

    def __init__(
        self,
        width: int,
        layers: Sequence[Layer],
        signs: FloatArray,
        inputs: Sequence[str],
        parameters: Sequence[str],
        dtype: torch.dtype,
    ):
        self.operators = Operators(width, layers, parameters, dtype)
        self.phases = Phases(width, self.operators.layers, inputs, dtype)
        self._signs = torch.tensor(signs, dtype=dtype)
        self._start = torch.zeros((1, 2**width, 1), dtype=dtype.to_complex())
        self._start[0, 0] = 1.0

    def __call__(self, x: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """`<O>` (B, observables) for x (B, inputs) and theta (parameters,)."""
        found: torch.Tensor = _Expectation.apply(x, theta, self)  # type: ignore[no-untyped-call]
        return found

    def evaluate(self, x: torch.Tensor, theta: torch.Tensor) -> tuple[torch.Tensor, Trace]:
        """`<O>` (B, observables), and the trace for its gradient."""
        bound, phases = self.operators(theta), self.phases(x)
        factors = phases.unbind()
        state = shared = self._start
        for layer, matrices in enumerate(bound.of_layers()):
            if layer == self.phases.first:
                shared = state
            phase = self.phases.of_layer[layer]
            state = state if phase is None else state * factors[phase]
            state = self.operators.apply(layer, matrices, state)
        probabilities = torch.view_as_real(state[0]).square().sum(dim=2)
        found = (probabilities.T @ self._signs).expand(len(x), -1)
        return found, Trace(bound, phases, shared, state)

    def gradient(
        self, trace: Trace, by_found: torch.Tensor, by_x: bool, by_theta: bool
    ) -> tuple[torch.Tensor | None, torch.Tensor | None]:
        """The gradients by x and theta, where wanted, for that by `<O>` (B, observables)."""
        if self.phases.first is None:
            by_found, by_x = by_found.sum(dim=0, keepdim=True), False
        # <O> changes by 2 Re <bra|d state>, and a bra is undone by transposed matrices.
        bra = (self._signs @ by_found.T) * trace.last.conj()
        both = torch.cat([trace.last, bra])
        inverses, factors = trace.bound.inverses(), trace.phases
        undoing = torch.stack([factors.conj(), factors], dim=1).unbind()
        moments, derivatives = [], []
        for layer in reversed(range(len(self.phases.of_layer))):
            both = self.operators.undo(layer, inverses[layer], both)
            if by_theta and self.operators.is_trained[layer]:
                moments.append(self.operators.moments(both))
            phase = self.phases.of_layer[layer]
            if phase is None:
                continue
            if by_x:
                derivatives.append(self.phases.derivative(*both.unbind()))
            if layer == self.phases.first:
                bra = (both[1:] * factors[phase]).sum(dim=2, keepdim=True)
                both = torch.cat([trace.shared, bra])
            else:
                both = both * undoing[phase]
        return (
            self.phases.gradient(derivatives[::-1]) if by_x else None,
            self.operators.gradient(trace.bound, moments[::-1]) if moments else None,
        )


class Trace(NamedTuple):
    """What `Block.gradient` needs of an evaluation.

    `shared` is the state that inputs enter first, `last` the one that is measured.
    """

    bound: Bound
    phases: torch.Tensor
    shared: torch.Tensor
    last: torch.Tensor


class Phases:
    """The phases by inputs of layers: `of_layer` has the number of each one's, or None.

    Layers with the same angles have the same number. `first` is the first layer with phases.
    """

    def __init__(
        self, width: int, layers: Sequence[Layer], inputs: Sequence[str], dtype: torch.dtype
    ):
        angles = [
            tuple(layer.phases.get(qubit, Angle()) for qubit in range(width)) for layer in layers
        ]
        turned = [of_layer for of_layer, layer in zip(angles, layers, strict=True) if layer.phases]
        number = {of_layer: i for i, of_layer in enumerate(dict.fromkeys(turned))}
        self.of_layer = [number.get(of_layer) for of_layer in angles]
        self.first = next((i for i, layer in enumerate(layers) if layer.phases), None)
        self._of_all = Forms([angle for row in turned for angle in row], inputs, dtype)
        self._signs = torch.tensor(1.0 - 2.0 * _bits(width), dtype=dtype)
        # Rz(a) is (1, exp(i a)), up to global phase.
        of_groups = [[row[part.start : part.stop] for row in number] for part in groups(width)]
        self._groups = [
            Forms([angle for row in rows for angle in _sums(row)], inputs, dtype)
            for rows in of_groups
        ]
        self._count = len(number)

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        """The factors of amplitudes, up to global phase, (numbers, 2**width, B)."""
        product: torch.Tensor | None = None
        for forms in self._groups:
            phases = forms(x.T)
            factors = torch.complex(phases.cos(), phases.sin())
            factors = factors.view(self._count, len(forms) // max(1, self._count), len(x))
            if product is None:
                product = factors
            else:
                product = (product[:, :, None] * factors[:, None]).flatten(1, 2)
        assert product is not None
        return product

    def derivative(self, state: torch.Tensor, bra: torch.Tensor) -> torch.Tensor:
        """The gradient by the angles of all qubits, (width, B), for states in a layer."""
        return self._signs @ (bra * state).imag

    def gradient(self, derivatives: list[torch.Tensor]) -> torch.Tensor:
        """The gradient by x, (B, inputs), for the derivatives of layers with phases in order."""
        return self._of_all.gradient(torch.cat(derivatives)).T


def _sums(angles: Sequence[Angle]) -> list[Angle]:
    """The sum of a subset of angles for each number, whose bits choose them, the highest first."""
    sums = [Angle()]
    for angle in angles:
        sums = [part for before in sums for part in (before, before + angle)]
    return sums


def _bits(width: int) -> IntArray:
    """The bits of all numbers, the highest first: (width, 2**width)."""
    bits: IntArray = np.arange(2**width) >> np.arange(width - 1, -1, -1)[:, None] & 1
    return bits


class _Expectation(torch.autograd.Function):
    """`Block.evaluate` with `Block.gradient`."""

    @staticmethod
    def forward(ctx: Any, x: torch.Tensor, theta: torch.Tensor, block: Block) -> torch.Tensor:
        found, ctx.trace = block.evaluate(x, theta)
        ctx.save_for_backward(x, theta)
        ctx.block = block
        return found

    @staticmethod
    def backward(ctx: Any, by_found: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        arguments = ctx.block, ctx.trace, by_found, *ctx.needs_input_grad[:2]
        if torch.is_grad_enabled():  # create_graph=True
            return *_Gradient.apply(*ctx.saved_tensors, *arguments), None  # type: ignore[no-untyped-call]
        return *_Gradient.forward(None, *ctx.saved_tensors, *arguments), None


class _Gradient(torch.autograd.Function):
    """`Block.gradient`, which cannot be differentiated."""

    @staticmethod
    def forward(
        ctx: Any, x: torch.Tensor, theta: torch.Tensor, block: Block, *arguments: Any
    ) -> tuple[torch.Tensor | None, torch.Tensor | None]:
        return block.gradient(*arguments)

    @staticmethod
    def backward(ctx: Any, *by_gradients: torch.Tensor) -> NoReturn:
        raise CircuitError(
            "Gradients of circuits of several qubits cannot be differentiated again.",
            "Leave second derivatives out of the loss.",
        )
