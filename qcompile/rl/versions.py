"""The versions that a training repeats with."""

from __future__ import annotations

import gymnasium
import numpy as np
import torch

from qcompile import __version__


def versions() -> dict[str, str]:
    """Package and version of all that a training's numbers depend on."""
    return {
        "qcompile": __version__,
        "torch": str(torch.__version__),
        "numpy": np.__version__,
        "gymnasium": gymnasium.__version__,
    }
