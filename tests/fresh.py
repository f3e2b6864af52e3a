"""A machine whose counts are never the same twice: not keyed by episode and decision."""

from __future__ import annotations

import numpy as np

from qcompile.device import Device
from qcompile.execution import Executor, OfflineExecutor, Prepared
from qcompile.passes import Executable


class FreshExecutor(Executor):
    """Counts of the device's noise model, drawn call by call from a generator of numpy's.

    Nothing of `qcompile.streams` is in them; without a seed every process has others. `rows` is
    the number of rows that were measured.
    """

    kind = "hardware"

    def __init__(self, device: Device, seed: int | None = None):
        self.device, self.rng, self.rows = device, np.random.default_rng(seed), 0

    def prepare(self, executable: Executable) -> Prepared:
        return _Fresh(executable, self)


class _Fresh(Prepared):
    shots_only = ("a machine has shots alone",)

    def __init__(self, executable: Executable, machine: FreshExecutor):
        super().__init__(executable)
        self._machine = machine
        self._exact = OfflineExecutor(machine.device).prepare(executable)

    def ones(self, x, theta, shots, rng=None):  # type: ignore[no-untyped-def]
        p_one = np.clip(self._exact.p_one(x, theta), 0, 1)
        self._machine.rows += len(p_one)
        return self._machine.rng.binomial(shots, p_one)
