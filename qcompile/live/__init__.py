"""Runs on real hardware: each job is sent once, within a limit, and no paid result is lost."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qcompile.live.sampler import GuardedSampler

__all__ = ["GuardedSampler"]


def __getattr__(name: str) -> Any:
    """Load GuardedSampler, which needs Qiskit, on first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if find_spec("qiskit") is None:
        from qcompile.errors import MissingExtraError

        raise MissingExtraError("A sampler on real hardware", "ibm")
    return getattr(import_module("qcompile.live.sampler"), name)
