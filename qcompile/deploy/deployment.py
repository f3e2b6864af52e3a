"""A policy compiled for a backend, which maps observations to actions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.measurement import Measurement
from qcompile.deploy.player import GATES
from qcompile.deploy.rows import Rows, executions
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.execution import (
    Backend,
    Executor,
    Kind,
    OfflineExecutor,
    TwinExecutor,
    Workload,
    open_executor,
)
from qcompile.policy import Policy
from qcompile.policy.policy import NO_THETA
from qcompile.streams import Draws


class Deployment:
    """A policy compiled for a device, which maps observations to actions.

    Plays with `settings`, or the defaults, with `changes`; its attribute `settings` has them
    resolved. Shots and actions are drawn from streams keyed by seed, episode and decision, so an
    episode repeats alone and alongside others; an initial calibration draws from a generator with
    the seed. `misfits` are the fits of its calibration that contradict their own counts.

    Raises:
        CalibrationError: the mitigation is unknown, or a qubit cannot be calibrated.
        CircuitError: copies are out of range.
        CountsError: shots or steps are out of range.
        OptionError: settings contradict each other.
    """

    def __init__(
        self,
        policy: Policy,
        backend: str | Device | Backend | Executor,
        settings: RunSettings | None = None,
        **changes: Any,
    ):
        chosen = RunSettings.of(settings, **changes)
        calibration_seed, _ = np.random.SeedSequence(chosen.seed).spawn(2)
        executor = open_executor(backend, calibration_seed)
        self.policy, self.executor, self.device = policy, executor, executor.device
        resolved = chosen.resolved(executor.device, executor.calibration)
        self._measure = Measurement(policy.trained_program, executor, resolved, policy.importance)
        self.settings = self._measure.settings
        self._draws = Draws(chosen.seed, self.settings.places * len(policy.program))
        self._decisions = 0
        self.executable = self._measure.executable
        self.calibration_load = self._measure.calibration_load
        self.calibration_shots = self._measure.calibration_shots
        self.misfits = self._measure.misfits

    def __repr__(self) -> str:
        return f"Deployment({self.policy.name} on {self.device.name})"

    @property
    def backend(self) -> str:
        """The name of its device."""
        return self.device.name

    @property
    def kind(self) -> Kind:
        """The kind of its executor's counts."""
        return self.executor.kind

    @property
    def copies(self) -> int:
        """The number of episodes that share an execution."""
        return 1 if self.settings.split else self.settings.copies or 1

    def expectation(self, observations: FloatArray, rows: Rows | None = None) -> FloatArray:
        """Measured and mitigated `<O>` of every observable, (B, observables).

        By default these are the `<Z>` of the circuits. Without `rows`, shots are drawn from the
        executor's own generator.
        """
        return self._measure(self.policy.encode(observations), NO_THETA, rows, self._draws)

    def act(
        self,
        observations: FloatArray,
        rows: Rows | None = None,
        note: Callable[[FloatArray], None] | None = None,
    ) -> IntArray:
        """An action for each of the observations (B, features).

        `rows` gives the episode and decision of each row; without it row i is episode i, and every
        call is the next decision.
        `note` gets the `<Z>` (B, circuits) that the policy decides by.
        """
        if rows is None:
            rows = Rows.of(len(observations), self._decisions)
            self._decisions += 1
        z = self.expectation(observations, rows)
        if note is not None:
            note(z)
        if self.settings.greedy:
            return self.policy.greedy(z)
        return self.policy.decide(z, self._draws.actions(rows.episode, rows.decision))

    def predict(self, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) that `act` would most likely return for these rows, without measuring.

        They use the same uniform numbers, and `<Z>` without shot noise: from the executor if it has
        expectations; else from the twin of the settings' calibration, if that has response curves,
        the level is 2 and circuits have one qubit; else from the device's noise model.
        """
        return self._predictor.act(observations, rows)

    @cached_property
    def _predictor(self) -> Deployment:
        """The deployment without shot noise, with the same placement if its device is the same."""
        settings, known = RunSettings.of(self.settings, shots=None), self.settings.calibration
        if self._measure.has_expectations:
            return Deployment(self.policy, self.executor, settings)
        has_twin = settings.level == 2 and not self.policy.program.has_products
        if has_twin and known is not None and known.response is not None:
            return Deployment(self.policy, TwinExecutor(known), settings)
        # A calibration of the machine does not fit the noise model, which gets its own.
        model = OfflineExecutor(self.device)
        return Deployment(self.policy, model, settings, calibration=None, calibration_file=None)

    def executions(self, rows: Rows) -> int:
        """The executions of its program that a step with these rows takes."""
        return executions(rows, self.copies)

    def load(self, executions: int) -> Workload:
        """Jobs and executions (times shots and rounds) of such a step."""
        shots = self.settings.program_shots
        return Workload.of_batch(executions, self.executable.round_count, shots)

    def sizes(self) -> dict[str, Any]:
        """Largest gate counts of a circuit, circuits and rounds, as in `qcompile run --json`."""
        counts = self.executable.gate_counts()
        couplings = (circuit.couplings for circuit in self.executable.native.circuits)
        return {
            "gates_per_circuit": {
                gate: max((count[gate] for count in counts), default=0)
                for gate in (*GATES, *self.device.coupling_gates * self.policy.program.is_wide)
            },
            "couplings_per_circuit": max(couplings, default=0),
            "circuits_per_step": len(self.policy.program),
            "observables_per_step": len(self.policy.program.measured),
            "rounds_per_step": self.executable.round_count,
        }
