"""A stand-in for IBM's Quantum REST API, to test runs on real machines.

The unmodified client of qiskit-ibm-runtime talks to it over HTTP: service, backends, calibration,
jobs of both samplers, batches, results and usage. Error codes other than 1305 (a job ran too long)
and 1352 (no sessions on the Open Plan) are its own.
"""

from .answers import CHARGES, SHAPES, Reshape
from .errors import ApiError
from .faults import Chance, Fault, Faults, Once, Orders
from .identity import API_KEY, CRN
from .jobs import MAX_EXECUTIONS, Entry, Ledger, usage_seconds
from .settings import Settings
from .stand_in import StandIn
from .troubles import TROUBLES, Trouble

__all__ = [
    "API_KEY",
    "CHARGES",
    "CRN",
    "MAX_EXECUTIONS",
    "SHAPES",
    "TROUBLES",
    "ApiError",
    "Chance",
    "Entry",
    "Fault",
    "Faults",
    "Ledger",
    "Once",
    "Orders",
    "Reshape",
    "Settings",
    "StandIn",
    "Trouble",
    "usage_seconds",
]
