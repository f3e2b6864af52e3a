"""Executors: from an executable and a batch of inputs to counts."""

from qcompile.execution.cost import qpu_seconds
from qcompile.execution.executor import (
    Executor,
    Kind,
    check_shots,
    expectation_from_ones,
)
from qcompile.execution.offline import OfflineExecutor

__all__ = [
    "Executor",
    "Kind",
    "OfflineExecutor",
    "check_shots",
    "expectation_from_ones",
    "qpu_seconds",
]
