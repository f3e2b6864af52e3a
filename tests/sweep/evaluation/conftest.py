"""Cells of a tiny policy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qcompile.execution import load_backend
from qcompile.policy import Policy, load_policy
from qcompile.sweep.evaluation.grid import Cell


@pytest.fixture
def policy() -> Policy:
    """The shipped CartPole policy, made worse: its episodes are short, and differ under noise."""
    shipped = load_policy("cartpole")
    return replace(shipped, name="tiny", weights=0.1 * shipped.weights, bias=np.zeros(2))


@pytest.fixture
def cell(policy: Policy) -> Callable[..., Cell]:
    """A cell of three episodes on ibm_lima, with these changes."""

    def make(**changes: Any) -> Cell:
        plain = Cell(policy, load_backend("ibm_lima"), 16, "none", 2, 3, 5)
        return replace(plain, **changes)

    return make
