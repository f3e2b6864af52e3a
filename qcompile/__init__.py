"""Policies of single-qubit variational circuits on IBM devices: trained, compiled and played.

What each command does is one call:

run          play episodes with a policy on a backend
evaluate     play a grid of policies, backends, shots and mitigations
train        train a policy with PPO
calibrate    measure the readout and the response of a device's qubits
validate     test a calibration's twin against fresh counts
plan         say what episodes cost on a machine, in each way to run them
study        train the rows of a study: the paper's, or your own

load_policy, load_backend, load_device and load_calibration read the arguments of these calls; each
takes a name, a file or an object. Every object has a short repr; results also have `plot`,
`to_dict` and `save`. `compile`, `Program` and `OfflineExecutor` lead from circuits to counts; pass
an `Ansatz` to `train` to train circuits of your own.

Each name loads its module on first use, so `import qcompile` is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from qcompile.version import __version__ as __version__

if TYPE_CHECKING:
    from qcompile.calibration import Calibration, load_calibration
    from qcompile.device import Device, load_device
    from qcompile.errors import OptionError, QcompileError
    from qcompile.execution import (
        OfflineExecutor,
        TwinExecutor,
        expectation_from_ones,
        load_backend,
    )
    from qcompile.ir import Angle, Circuit, Gate, Program
    from qcompile.passes import Executable, compile
    from qcompile.policy import Ansatz, Encoder, Network, Policy, load_policy, save_policy
    from qcompile.simulate import Simulator
    from qcompile.verbs.calibrate import calibrate
    from qcompile.verbs.evaluate import evaluate
    from qcompile.verbs.live import Live
    from qcompile.verbs.plan import plan
    from qcompile.verbs.run import run
    from qcompile.verbs.study import study
    from qcompile.verbs.train import train
    from qcompile.verbs.validate import validate

_HOMES = {
    "run": "qcompile.verbs.run",
    "evaluate": "qcompile.verbs.evaluate",
    "train": "qcompile.verbs.train",
    "calibrate": "qcompile.verbs.calibrate",
    "validate": "qcompile.verbs.validate",
    "plan": "qcompile.verbs.plan",
    "study": "qcompile.verbs.study",
    "Angle": "qcompile.ir",
    "Ansatz": "qcompile.policy",
    "Calibration": "qcompile.calibration",
    "Circuit": "qcompile.ir",
    "Device": "qcompile.device",
    "Encoder": "qcompile.policy",
    "Executable": "qcompile.passes",
    "Gate": "qcompile.ir",
    "Live": "qcompile.verbs.live",
    "Network": "qcompile.policy",
    "OfflineExecutor": "qcompile.execution",
    "OptionError": "qcompile.errors",
    "Policy": "qcompile.policy",
    "Program": "qcompile.ir",
    "QcompileError": "qcompile.errors",
    "Simulator": "qcompile.simulate",
    "TwinExecutor": "qcompile.execution",
    "compile": "qcompile.passes",
    "expectation_from_ones": "qcompile.execution",
    "load_backend": "qcompile.execution",
    "load_calibration": "qcompile.calibration",
    "load_device": "qcompile.device",
    "load_policy": "qcompile.policy",
    "save_policy": "qcompile.policy",
}

__all__ = [  # noqa: RUF022
    "run",
    "evaluate",
    "train",
    "calibrate",
    "validate",
    "plan",
    "study",
    "Angle",
    "Ansatz",
    "Calibration",
    "Circuit",
    "Device",
    "Encoder",
    "Executable",
    "Gate",
    "Live",
    "Network",
    "OfflineExecutor",
    "OptionError",
    "Policy",
    "Program",
    "QcompileError",
    "Simulator",
    "TwinExecutor",
    "compile",
    "expectation_from_ones",
    "load_backend",
    "load_calibration",
    "load_device",
    "load_policy",
    "save_policy",
]


def __getattr__(name: str) -> Any:
    if name in ("nn", "qiskit"):  # modules: they load torch and Qiskit
        return import_module(f"qcompile.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'qcompile' has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
