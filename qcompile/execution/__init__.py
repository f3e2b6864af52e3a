"""Executors: from an executable and a batch of inputs to counts."""

from qcompile.device import Kind
from qcompile.execution.backend import Backend, DeviceBackend
from qcompile.execution.cost import Workload, portions, qpu_seconds
from qcompile.execution.executor import Executor, expectation_from_ones
from qcompile.execution.offline import OfflineExecutor
from qcompile.execution.open import load_backend, open_device, open_executor
from qcompile.execution.prepared import (
    Binomial,
    ExactPrepared,
    Prepared,
    check_shots,
    draw_ones,
    require_exact,
)
from qcompile.execution.primitive import PrimitiveExecutor
from qcompile.execution.twin import TwinExecutor

__all__ = [
    "Backend",
    "Binomial",
    "DeviceBackend",
    "ExactPrepared",
    "Executor",
    "Kind",
    "OfflineExecutor",
    "Prepared",
    "PrimitiveExecutor",
    "TwinExecutor",
    "Workload",
    "check_shots",
    "draw_ones",
    "expectation_from_ones",
    "load_backend",
    "open_device",
    "open_executor",
    "portions",
    "qpu_seconds",
    "require_exact",
]
