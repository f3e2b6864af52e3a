"""Explains valid parts of policy files that this version cannot run."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.errors import PolicyError
from qcompile.policy.blocks import BlockFile, Observables, single_bits
from qcompile.validation import listed


class UnsupportedPolicyError(PolicyError):
    """The policy file is valid, but this version cannot run what it describes."""


def wide_blocks(blocks: Sequence[BlockFile | None]) -> list[str]:
    """A line about blocks of more than one qubit, if any; None stands for a plain circuit."""
    wide = {
        index: block for index, block in enumerate(blocks) if block is not None and block.qubits > 1
    }
    if not wide:
        return []
    numbers = listed([f"circuits.{index}" for index in wide], 4)
    widest = max(block.qubits for block in wide.values())
    names = sorted({name for block in wide.values() for name in block.couplings})
    couplings = f", with {', '.join(names)}" if names else ""
    return [
        f"{numbers}: blocks of up to {widest} qubits{couplings}. This version runs circuits of "
        "one qubit."
    ]


def products(observables: Observables | None, bits: int) -> list[str]:
    """A line about observables other than each of the `bits` bits alone, in order."""
    if observables is None or [*map(list, observables)] == single_bits(bits):
        return []
    few = listed([str([*bits]) for bits in observables], 4)
    return [f"observables {few}: this version measures each bit alone, in order ([0], [1], ...)."]


def other_decision(decision: str) -> list[str]:
    """A line about a decision other than softmax."""
    if decision == "softmax":
        return []
    return [f"decision {decision}: this version draws actions from the softmax of the outputs."]


def refuse(lines: Sequence[str]) -> None:
    """Raise UnsupportedPolicyError with `lines`, unless there are none."""
    if lines:
        raise UnsupportedPolicyError("\n".join(lines))
