"""Policies: encoder, program and head; their files; the circuits they are usually made of."""

from qcompile.policy.files import load_policy, policy_names, save_policy
from qcompile.policy.policy import ENCODINGS, Encoder, Policy, draw_actions

__all__ = [
    "ENCODINGS",
    "Encoder",
    "Policy",
    "draw_actions",
    "load_policy",
    "policy_names",
    "save_policy",
]
