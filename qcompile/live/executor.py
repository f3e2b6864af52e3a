"""The executor of a live backend: batches become jobs of packed circuits."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.device import Device
from qcompile.errors import LiveError
from qcompile.execution import Binomial, Executor, Kind, Prepared, portions
from qcompile.execution.executor import check_device
from qcompile.execution.packed import PackedExecutable
from qcompile.execution.prepared import most_shots
from qcompile.live.jobs import Jobs
from qcompile.live.request import Request
from qcompile.passes import Executable


class IBMExecutor(Executor):
    """Runs executables on a machine of IBM's, through the jobs of a run.

    A call is one job of a circuit for each round, with its angles as arrays over the batch; more
    jobs only where IBM's limit of executions wants them (`execution.portions`). A job that cannot
    be had is a LiveError; the run can be resumed later.
    """

    kind: Kind = "hardware"

    def __init__(self, device: Device, jobs: Jobs):
        self.device, self._jobs = device, jobs

    def prepare(self, executable: Executable) -> Prepared:
        """The executable with the jobs it takes.

        Raises:
            DeviceError: it was compiled for another device.
        """
        check_device(executable, self.device)
        return _Sent(executable, self._jobs)


class _Sent(PackedExecutable):
    def __init__(self, executable: Executable, jobs: Jobs):
        super().__init__(executable)
        self._jobs = jobs
        self.shots_only = (
            f"{executable.device.name} is a machine, which only has shots.",
            "Give a number of shots, 1024 say.",
        )

    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        most = most_shots(shots)
        angles = self.executable.bind(x, theta)
        ones = np.zeros((len(angles), len(self.executable.native)), dtype=np.int64)
        if not ones.size:
            return ones
        for portion in portions(len(angles), self.executable.round_count, most):
            rows = slice(portion.rows.start, portion.rows.stop)
            request = Request(self, angles[rows], portion.rounds, most, shots)
            ones[rows, request.circuits] = self._counts(request)
        return ones

    def _counts(self, request: Request) -> CountArray:
        """The ones of a job, (rows, circuits); those of a journal are held to its shape and shots.

        Raises:
            LiveError: a job cannot be had, or the journal is damaged.
        """
        ones = self._jobs.ones(request)
        shape = len(request.angles), len(request.circuits)
        fits = ones.dtype.kind == "i" and ones.shape == shape
        if not fits or ones.min() < 0 or ones.max() > request.shots:
            path = self._jobs.journal.path
            raise LiveError(f"{path} is damaged: the counts of a job are wrong.", "Restore a copy.")
        return ones
