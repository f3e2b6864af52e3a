"""What one job measures."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray, IntArray
from qcompile.execution.packed import REGISTER, PackedExecutable, PackedRound, count_ones
from qcompile.passes import Executable

_DIGITS = 9
"""Of an angle: another processor may round the last ones otherwise."""


@dataclass(frozen=True, eq=False)
class Request:
    """Some rounds of an executable with their angles (rows, slots) and shots, for one job."""

    packed: PackedExecutable
    angles: FloatArray
    rounds: range
    shots: int
    counted: CircuitShots
    """How many of the shots count of each circuit of the executable."""

    @property
    def executable(self) -> Executable:
        return self.packed.executable

    @property
    def executions(self) -> int:
        return len(self.angles) * len(self.rounds) * self.shots

    @cached_property
    def circuits(self) -> IntArray:
        """The circuits of these rounds, in order."""
        return np.flatnonzero(np.isin(self.executable.rounds, self.rounds))

    @property
    def digest(self) -> str:
        """The same for the same circuits, qubits, angles and shots, and for nothing else.

        Journals of every version hold it, so it is that of version 0.1.0: of the angles as
        (rows, circuits, positions), 0 where a circuit has fewer slots than others.
        """
        executable = self.executable
        owners, positions = executable.slot_circuits, executable.slot_positions
        shape = len(self.angles), len(executable.native), int(positions.max()) + 1
        angles = np.zeros(shape)
        angles[:, owners, positions] = self.angles
        parts = (
            str(executable.native).encode(),
            executable.qubits.tobytes(),
            executable.rounds.tobytes(),
            str((self.rounds, self.shots, shape)).encode(),
            (np.round(angles, _DIGITS) + 0.0).tobytes(),  # no -0.0
        )
        return hashlib.sha256(b"".join(parts)).hexdigest()

    def pubs(self) -> list[Any]:
        """Circuits and their values, as SamplerV2 takes them."""
        return [self._pub(packed) for packed in self._rounds]

    @property
    def _rounds(self) -> list[PackedRound]:
        return [self.packed.rounds[index] for index in self.rounds]

    def _pub(self, packed: PackedRound) -> Any:
        """A round and its values; without open angles, and for one row, the circuit alone."""
        if packed.slots.size or len(self.angles) > 1:
            return packed.pub(self.angles)
        return (packed.circuit.assign_parameters(dict.fromkeys(packed.parameters, 0.0)),)

    def ones(self, result: Any) -> CountArray:
        """The ones of each circuit, (rows, circuits), of a sampler's result.

        Raises:
            ValueError: the result is not that of these pubs.
        """
        rounds, bits = self._rounds, []
        if len(result) != len(rounds):
            raise ValueError(f"{len(result)} results for {len(rounds)} circuits")
        for packed, pub in zip(rounds, result, strict=True):
            of_round = np.asarray(getattr(pub.data, REGISTER).array, dtype=np.uint8)
            wanted = (len(self.angles), self.shots, -(-len(packed.circuits) // 8))
            if of_round.size != np.prod(wanted):
                raise ValueError(f"bits of shape {of_round.shape} instead of {wanted}")
            bits.append(of_round.reshape(wanted))
        return count_ones(rounds, bits, self.circuits, self.counted)
