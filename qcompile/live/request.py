"""The request for one job: PUBs with the same shots, and the registers they measure."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.errors import LiveError
from qcompile.live.circuits import circuit_text, rounded, unsupported
from qcompile.live.records import Register

DIGEST = "pubs-1 "
"""The prefix of a digest of PUBs. Digests in earlier journals were computed differently."""
TAG = "pubs-"


def is_same(recorded: str, digest: str) -> bool:
    """Whether a recorded job may have this digest; digests of earlier journals always may."""
    return recorded == digest or not recorded.startswith(DIGEST)


def tag_of(digest: str) -> str:
    """A tag that identifies a job's PUBs; jobs of older versions have none."""
    return TAG + digest.removeprefix(DIGEST)[:16]


@dataclass(frozen=True, eq=False)
class Request:
    """SamplerPubs for one job, each with `shots` shots."""

    pubs: tuple[Any, ...]
    shots: int

    @property
    def executions(self) -> int:
        return self.shots * sum(int(pub.size) for pub in self.pubs)

    @property
    def registers(self) -> list[Register]:
        """The registers to be measured, in order, without bits."""
        return [
            Register(index, register.name, (*pub.shape, self.shots), register.size)
            for index, pub in enumerate(self.pubs)
            for register in pub.circuit.cregs
        ]

    @cached_property
    def digest(self) -> str:
        """A digest of circuits, values and shots."""
        digest = hashlib.sha256()
        for pub in self.pubs:
            values = pub.parameter_values.as_array(pub.circuit.parameters)
            head = f"{circuit_text(pub.circuit)}\n{values.shape} {self.shots}\n"
            digest.update(head.encode())
            digest.update(rounded(values).astype("<f8").tobytes())
        return DIGEST + digest.hexdigest()

    def check_runs_on(self, backend: str, target: Any) -> None:
        """Check that each circuit consists of instructions in the Target of `backend`.

        Raises:
            LiveError: one does not, so that the job would fail.
        """
        for index, pub in enumerate(self.pubs):
            if words := unsupported(pub.circuit, target):
                raise LiveError(
                    f"{backend} cannot run circuit {index} of the job.",
                    words,
                    "Compile it for the machine: generate_preset_pass_manager(backend=backend).",
                )


def measured(registers: Sequence[Register], result: Any) -> list[Register]:
    """`registers` filled with the bits in a sampler's result.

    Raises:
        ValueError, KeyError: the result does not belong to these PUBs.
    """
    pubs = 1 + max(register.pub for register in registers)
    if len(result) != pubs:
        raise ValueError(f"{len(result)} results for {pubs} PUBs")
    filled = []
    for register in registers:
        bits = result[register.pub].data[register.name]
        packed = np.asarray(bits.array, dtype=np.uint8)
        if bits.num_bits != register.width or packed.size != register.packed_size:
            raise ValueError(f"bits of shape {packed.shape} for {register}")
        filled.append(replace(register, packed=packed.tobytes()))
    return filled
