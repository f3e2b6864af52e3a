"""Policies: encoder, program and head; their files; the circuits they are usually made of."""

from qcompile.policy.ansatz import Ansatz
from qcompile.policy.ansatz_file import load_ansatz
from qcompile.policy.encoder import ENCODINGS, Encoder
from qcompile.policy.files import load_policy, policy_names, save_policy
from qcompile.policy.policy import Policy

__all__ = [
    "ENCODINGS",
    "Ansatz",
    "Encoder",
    "Policy",
    "load_ansatz",
    "load_policy",
    "policy_names",
    "save_policy",
]
