"""One circuit of several qubits in torch: `<O>` for a batch, and its gradient.

The state is (2**width, B), or (2**width, 1) before the first layer that inputs enter: all rows
share the operators of layers, and only phases differ. The gradient walks back from the last state
and undoes layer after layer, so that memory does not grow with their number. Source: arXiv
2009.02823 (the adjoint method).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import CircuitError
from qcompile.ir import Angle
from qcompile.states.layers import Layer
from qcompile.states.operators import Bound, Operators, groups
from qcompile.states.rotations import Forms


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
        self._start = torch.zeros((2**width, 1), dtype=dtype.to_complex())
        self._start[0] = 1.0

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
        probabilities = torch.view_as_real(state).square().sum(dim=2)
        found = (probabilities.T @ self._signs).expand(len(x), -1)
        return found, Trace(bound, phases, shared, state)

    def gradient(
        self, trace: Trace, by_found: torch.Tensor, by_x: bool, by_theta: bool
    ) -> tuple[torch.Tensor | None, torch.Tensor | None]:
        """The gradients by x and theta, where wanted, for that by `<O>` (B, observables)."""
        if self.phases.first is None:
            by_found, by_x = by_found.sum(dim=0, keepdim=True), False
        state = trace.last
        bra = (self._signs @ by_found.T) * state.conj()  # <O> changes by 2 Re <bra|d state>
        # A bra is undone by transposed matrices.
        inverses, transposes = trace.bound.inverses(), trace.bound.transposes()
        factors, conjugates = trace.phases.unbind(), trace.phases.conj().resolve_conj().unbind()
        moments, derivatives = [], []
        for layer in reversed(range(len(self.phases.of_layer))):
            state = self.operators.undo(layer, inverses[layer], state)
            bra = self.operators.undo(layer, transposes[layer], bra)
            if by_theta:
                moments.append(self.operators.moments(state, bra))
            phase = self.phases.of_layer[layer]
            if phase is None:
                continue
            if by_x:
                derivatives.append(self.phases.derivative(state, bra))
            bra = bra * factors[phase]
            if layer == self.phases.first:
                state, bra = trace.shared, bra.sum(dim=1, keepdim=True)
            else:
                state = state * conjugates[phase]
        return (
            self.phases.gradient(derivatives[::-1]) if by_x else None,
            self.operators.gradient(trace.bound, moments[::-1]) if by_theta else None,
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
        self._shape = len(number), width
        self._forms = Forms([angle for row in number for angle in row], inputs, dtype, 1)
        self._of_all = Forms([angle for row in turned for angle in row], inputs, dtype, 1)
        self._signs = torch.tensor(1.0 - 2.0 * _bits(width), dtype=dtype)
        self._groups = [
            (qubits, torch.tensor(_bits(len(qubits)).T, dtype=dtype)) for qubits in groups(width)
        ]

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        """The factors of amplitudes, up to global phase, (numbers, 2**width, B)."""
        angles = self._forms(x.T).reshape(self._shape[0], self._shape[1], len(x))
        product: torch.Tensor | None = None
        for qubits, bits in self._groups:
            phases = bits @ angles[:, qubits.start : qubits.stop]
            factors = torch.complex(phases.cos(), phases.sin())
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
