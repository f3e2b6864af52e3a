"""The executor of a live backend: batches become jobs of packed circuits."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.device import Device
from qcompile.errors import CountsError, LiveError
from qcompile.execution import Kind, check_shots, portions
from qcompile.execution.executor import check_device
from qcompile.execution.packed import REGISTER, PackedRound, count_ones, pack_round
from qcompile.live.jobs import Jobs
from qcompile.passes import Executable

_DIGITS = 9
"""Of an angle: another processor may round the last ones otherwise."""


class IBMExecutor:
    """Runs executables on a machine of IBM's, through the jobs of a run.

    A call is one job of a circuit for each round, with its angles as arrays over the batch; more
    jobs only where IBM's limit of executions wants them (`execution.portions`).
    """

    kind: Kind = "hardware"

    def __init__(self, device: Device, jobs: Jobs):
        self.device, self._jobs = device, jobs
        self._packed: WeakKeyDictionary[Executable, list[PackedRound]] = WeakKeyDictionary()

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The number of ones of each circuit in `shots` shots, (B, circuits) integers.

        Raises:
            CircuitError: x or theta has another shape.
            CountsError: shots out of range.
            DeviceError: the executable was compiled for another device.
            LiveError: a job cannot be had; the run can go on later.
        """
        check_shots(shots)
        check_device(executable, self.device)
        angles = executable.bind_slots(x, theta)
        ones = np.zeros((len(angles), len(executable.native)), dtype=np.int64)
        if not ones.size:
            return ones
        for portion in portions(len(angles), executable.round_count, shots):
            rows = slice(portion.rows.start, portion.rows.stop)
            part = _Request(self, executable, angles[rows], portion.rounds, shots)
            ones[rows, part.circuits] = self._counts(part)
        return ones

    def _counts(self, part: _Request) -> CountArray:
        """The ones of a job, (rows, circuits); those of a journal are held to its shape and shots.

        Raises:
            LiveError: the journal is damaged.
        """
        ones = self._jobs.ones(part)
        fits = ones.dtype.kind == "i" and ones.shape == (len(part.angles), len(part.circuits))
        if not fits or ones.min() < 0 or ones.max() > part.shots:
            path = self._jobs.journal.path
            raise LiveError(f"{path} is damaged: the counts of a job are wrong.", "Restore a copy.")
        return ones

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> NoReturn:
        """A machine has no expectations without shot noise.

        Raises:
            CountsError: always.
        """
        raise CountsError(
            f"{self.device.name} is a machine, which only has shots.",
            "Give a number of shots, 1024 say.",
        )

    def packed(self, executable: Executable) -> list[PackedRound]:
        """The circuits of the executable's rounds, made once."""
        rounds = self._packed.get(executable)
        if rounds is None:
            rounds = [pack_round(executable, index) for index in range(executable.round_count)]
            self._packed[executable] = rounds
        return rounds


@dataclass(frozen=True)
class _Request:
    """Some rounds of an executable, for the angles (rows, circuits, slots)."""

    executor: IBMExecutor
    executable: Executable
    angles: FloatArray
    rounds: range
    shots: int

    @property
    def executions(self) -> int:
        return len(self.angles) * len(self.rounds) * self.shots

    @cached_property
    def circuits(self) -> CountArray:
        """The circuits of these rounds, in order."""
        return np.flatnonzero(np.isin(self.executable.rounds, self.rounds))

    @property
    def digest(self) -> str:
        made = self.executable
        parts = (
            str(made.native).encode(),
            made.qubits.tobytes(),
            made.rounds.tobytes(),
            str((self.rounds, self.shots, self.angles.shape)).encode(),
            (np.round(self.angles, _DIGITS) + 0.0).tobytes(),  # no -0.0
        )
        return hashlib.sha256(b"".join(parts)).hexdigest()

    def pubs(self) -> list[Any]:
        return [self._pub(packed) for packed in self._packed]

    @property
    def _packed(self) -> list[PackedRound]:
        rounds = self.executor.packed(self.executable)
        return [rounds[index] for index in self.rounds]

    def _pub(self, packed: PackedRound) -> Any:
        """A round and its values; without open angles, and for one row, the circuit alone."""
        if packed.owners.size or len(self.angles) > 1:
            return packed.pub(self.angles)
        return (packed.circuit.assign_parameters(dict.fromkeys(packed.parameters, 0.0)),)

    def ones(self, result: Any) -> CountArray:
        """(rows, circuits) of a PrimitiveResult; ValueError if it is not that of `pubs`."""
        packed, rows = self._packed, len(self.angles)
        if len(result) != len(packed):
            raise ValueError(f"{len(result)} results for {len(packed)} circuits")
        ones = np.zeros((rows, len(self.circuits)), dtype=np.int64)
        for made, pub in zip(packed, result, strict=True):
            bits = np.asarray(getattr(pub.data, REGISTER).array, dtype=np.uint8)
            wanted = (rows, self.shots, -(-len(made.circuits) // 8))
            if bits.size != np.prod(wanted):
                raise ValueError(f"bits of shape {bits.shape} instead of {wanted}")
            columns = np.searchsorted(self.circuits, made.circuits)
            ones[:, columns] = count_ones(bits.reshape(wanted), len(made.circuits))
        return ones
