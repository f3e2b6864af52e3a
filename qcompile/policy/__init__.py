"""Policies of circuits and networks, their files, and common circuit layouts."""

from qcompile.policy.ansatz import Ansatz
from qcompile.policy.ansatz_file import load_ansatz
from qcompile.policy.encoder import ENCODINGS, Encoder
from qcompile.policy.files import (
    AnyPolicy,
    load_circuits,
    load_policy,
    policy_names,
    save_policy,
)
from qcompile.policy.network import Convolution, Dense, Network
from qcompile.policy.policy import Policy

__all__ = [
    "ENCODINGS",
    "Ansatz",
    "AnyPolicy",
    "Convolution",
    "Dense",
    "Encoder",
    "Network",
    "Policy",
    "load_ansatz",
    "load_circuits",
    "load_policy",
    "policy_names",
    "save_policy",
]
