"""Compile policies of single-qubit variational circuits and play them on IBM devices.

The names below load their modules when they are first used, so `import qcompile` costs little.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from qcompile.version import __version__ as __version__

if TYPE_CHECKING:
    from qcompile.calibration import Calibration, load_calibration
    from qcompile.device import Device, load_device
    from qcompile.errors import QcompileError
    from qcompile.execution import OfflineExecutor, TwinExecutor, expectation_from_ones
    from qcompile.ir import Angle, Circuit, Gate, Program
    from qcompile.mitigation import calibrate
    from qcompile.passes import Executable, compile
    from qcompile.policy import Policy, load_policy, save_policy
    from qcompile.simulate import Simulator

_HOMES = {
    "Angle": "qcompile.ir",
    "Calibration": "qcompile.calibration",
    "Circuit": "qcompile.ir",
    "Device": "qcompile.device",
    "Executable": "qcompile.passes",
    "Gate": "qcompile.ir",
    "OfflineExecutor": "qcompile.execution",
    "Policy": "qcompile.policy",
    "Program": "qcompile.ir",
    "QcompileError": "qcompile.errors",
    "Simulator": "qcompile.simulate",
    "TwinExecutor": "qcompile.execution",
    "calibrate": "qcompile.mitigation",
    "compile": "qcompile.passes",
    "expectation_from_ones": "qcompile.execution",
    "load_calibration": "qcompile.calibration",
    "load_device": "qcompile.device",
    "load_policy": "qcompile.policy",
    "save_policy": "qcompile.policy",
}

__all__ = [
    "Angle",
    "Calibration",
    "Circuit",
    "Device",
    "Executable",
    "Gate",
    "OfflineExecutor",
    "Policy",
    "Program",
    "QcompileError",
    "Simulator",
    "TwinExecutor",
    "calibrate",
    "compile",
    "expectation_from_ones",
    "load_calibration",
    "load_device",
    "load_policy",
    "save_policy",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'qcompile' has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
