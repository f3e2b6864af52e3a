"""The request for a calibration, checked before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from qcompile.arrays import IntArray
from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.clashes import Named
from qcompile.device import Device, backend_path
from qcompile.errors import CalibrationError, OptionError
from qcompile.mitigation.measure import PARTS, Part, check_qubits
from qcompile.noise import unusable, usable
from qcompile.passes import compile
from qcompile.policy import Policy, load_circuits
from qcompile.policy.files import policy_path
from qcompile.report.placement import left_out_words
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.verbs.live import Live, check_live


@dataclass(frozen=True)
class CalibrationRequest:
    """What to measure: the arguments of `calibrate`."""

    backend: Any
    qubits: Sequence[int] | IntArray | None = None
    shots: int | None = 8192
    policy: Name | Policy | None = None
    parts: Part | Sequence[Part] | None = None
    seed: int | None = None
    live: Live | None = None
    progress: bool = True
    on_note: Words = ignore

    def check_words(self) -> None:
        """Check that the arguments fit each other.

        Raises:
            OptionError: they contradict each other.
        """
        if self.qubits is not None and self.policy is not None:
            raise OptionError(
                f"{option('qubits')} and {option('policy')} cannot be combined: both choose the "
                "qubits."
            )
        for part in self.asked:
            if part not in PARTS:
                raise OptionError(f"{part!r} is neither readout nor response.")
        check_live(self.live)
        if self.live is None:
            return
        exact = f"{option('shots')} exact"
        for name, given in ((option("seed"), self.seed is not None), (exact, self.shots is None)):
            if given:
                raise OptionError(f"{name} cannot be combined with {option('live')}.")
        if not isinstance(self.backend, str):
            raise OptionError("A live calibration needs the name of an IBM machine.")

    @property
    def reads(self) -> Named:
        """The files of the backend and the policy."""
        return {
            option("backend"): backend_path(self.backend),
            option("policy"): policy_path(self.policy),
        }

    @property
    def asked(self) -> tuple[Part, ...]:
        """The requested parts in their usual order; empty for the default."""
        parts = [] if self.parts is None else several(self.parts)
        return tuple(sorted(set(parts), key=[*PARTS, *parts].index))

    @property
    def live_parts(self) -> tuple[Part, ...]:
        """The parts to measure on a machine by default: those that can mitigate the policy."""
        if self.policy is not None and load_circuits(self.policy).program.has_products:
            return ("readout",)
        return ("response",)

    def qubits_on(self, device: Device, old: Calibration | None = None) -> IntArray:
        """The qubits to measure: the requested ones, those of the policy, of `old`, or all usable.

        Those of a policy are the qubits that it measures; routing may pass through others.

        Raises:
            CalibrationError: there are none, the device lacks one, or the device has no errors.
        """
        if self.qubits is not None:
            return check_qubits(device, self.qubits)
        if device.is_ideal and old is None:
            raise CalibrationError(
                f"{device.name} needs no calibration: it has no errors.",
                f"To measure some of its perfect qubits anyway, name them with {option('qubits')}.",
            )
        if self.policy is not None:
            policy = load_circuits(self.policy)
            placed = compile(policy.trained_program, device, 2, policy.importance)
            return check_qubits(device, placed.bit_qubits)
        if old is not None:
            return np.array(old.qubits)
        if reasons := unusable(device):
            self.on_note(left_out_words(reasons))
        return check_qubits(device, sorted(usable(device)))
