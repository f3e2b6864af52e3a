"""All trained parameters of a model in one tensor, so that an update takes few operations."""

from __future__ import annotations

import torch


class FlatParameters:
    """One parameter that shares memory and gradient with all trained parameters of `model`.

    Gradients accumulate in `parameter.grad` until `zero_gradient`.
    """

    def __init__(self, model: torch.nn.Module):
        trained = [p for p in model.parameters() if p.requires_grad]
        self.parameter = torch.nn.Parameter(torch.cat([p.detach().flatten() for p in trained]))
        self._gradient = torch.zeros_like(self.parameter)
        self.parameter.grad = self._gradient
        start = 0
        for p in trained:
            end = start + p.numel()
            p.data = self.parameter.data[start:end].view_as(p)
            p.grad = self._gradient[start:end].view_as(p)
            start = end

    def zero_gradient(self) -> None:
        self._gradient.zero_()

    def clip_gradient(self, most: float) -> None:
        """Clip the gradient to the norm `most`."""
        norm = self._gradient.norm()
        self._gradient.mul_((most / (norm + 1e-6)).clamp(max=1.0))
