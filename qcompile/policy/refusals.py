"""Explains valid parts of policy files that this version cannot run."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.errors import PolicyError


class UnsupportedPolicyError(PolicyError):
    """The policy file is valid, but this version cannot run what it describes."""


def other_decision(decision: str) -> list[str]:
    """A line about a decision other than softmax."""
    if decision == "softmax":
        return []
    return [f"decision {decision}: this version draws actions from the softmax of the outputs."]


def refuse(lines: Sequence[str]) -> None:
    """Raise UnsupportedPolicyError with `lines`, unless there are none."""
    if lines:
        raise UnsupportedPolicyError("\n".join(lines))
