"""Policy files as they are written: by hand, and by a policy with awkward numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.ir import Circuit, Program
from qcompile.policy import Encoder, Policy


@pytest.fixture
def values() -> Callable[[], dict[str, Any]]:
    """A valid file: two circuits over two features, two actions, output reuse 2."""

    def make() -> dict[str, Any]:
        return {
            "format": "qcompile-policy-1",
            "name": "small",
            "environment": "CartPole-v1",
            "encoder": {"function": "tanh", "feature": [3, 0], "scale": [1, 0.5]},
            "circuits": [
                [["h"], ["ry", "x0"], ["rz", "0.5*x1+theta0-1.57"]],
                [["h"], ["ry", "x1"], ["rz", "x1"], ["rx", 0.25]],
            ],
            "theta": [0.1],
            "weights": [[0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]],
            "bias": [0.0, -1.0],
            "reuse": 2,
        }

    return make


@pytest.fixture
def write_json() -> Callable[[Path, object], Path]:
    """Write a document as JSON, and give its path."""

    def make(path: Path, document: object) -> Path:
        path.write_text(json.dumps(document))
        return path

    return make


@pytest.fixture
def write_pt() -> Callable[[Path, object], Path]:
    """Write a document as torch does, and give its path."""

    def make(path: Path, document: object) -> Path:
        torch.save(document, path)
        return path

    return make


@pytest.fixture
def awkward() -> Callable[[], Policy]:
    """A policy whose numbers have all their 53 bits."""

    def make() -> Policy:
        rng = np.random.default_rng(0)
        return Policy(
            "awkward",
            "LunarLander-v3",
            Encoder("arctan", np.array([7, 2, 2]), rng.normal(size=3)),
            Program.of(
                [
                    Circuit.parse("h ry(x0) rz(x0+0.1*theta1) sx"),
                    Circuit.parse("p(-x1/3) tdg h rx(x2)"),
                ],
                3,
                2,
            ),
            rng.normal(size=2),
            rng.normal(size=(3, 8)) * 1e-9,
            rng.normal(size=3) * 1e9,
            4,
            {"seed": 3, "note": "trained\non a laptop", "scores": [1.5, None]},
        )

    return make
