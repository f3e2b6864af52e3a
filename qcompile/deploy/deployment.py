"""A policy compiled for a backend: from observations to actions."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration
from qcompile.deploy.measurement import Measurement
from qcompile.device import Device
from qcompile.execution import Backend, Executor, open_executor
from qcompile.policy import Policy

_NO_THETA = np.zeros(0)


class Deployment:
    """A policy compiled for a device: from observations to actions.

    `shots` None takes expectations without shot noise. Shot noise, calibration and the sampling
    of actions draw from generators derived from `seed`, so a deployment repeats exactly. With
    `copies` so many episodes share an execution, their circuits side by side on the device.
    `misfits` are the fits of its calibration that contradict their own counts.

    Raises:
        CalibrationError: `mitigation` is not one of MITIGATIONS, or a qubit cannot be calibrated.
        CircuitError: copies are out of range.
        CountsError: shots out of range.
    """

    def __init__(
        self,
        policy: Policy,
        backend: str | Device | Backend | Executor,
        *,
        shots: int | None = None,
        level: int = 2,
        mitigation: str = "none",
        calibration: Calibration | None = None,
        predistort: bool = False,
        greedy: bool = False,
        seed: int = 0,
        copies: int = 1,
    ):
        self.policy, self.shots, self.copies = policy, shots, copies
        self.predistort = predistort
        self.level, self.mitigation, self.greedy, self.seed = level, mitigation, greedy, seed
        noise_seed, action_seed = np.random.SeedSequence(seed).spawn(2)
        self._rng = np.random.default_rng(action_seed)
        self._measure = Measurement(
            policy.trained_program,
            open_executor(backend, noise_seed),
            shots=shots,
            level=level,
            mitigation=mitigation,
            calibration=calibration,
            predistort=predistort,
            importance=policy.importance,
            copies=copies,
        )
        self.calibration_load = self._measure.calibration_load
        self.misfits = self._measure.misfits
        self.executor, self.executable = self._measure.executor, self._measure.executable
        self.device = self.executor.device

    def expectation(self, observations: FloatArray) -> FloatArray:
        """`<Z>` of every circuit as measured and mitigated, (B, circuits)."""
        return self._measure(self.policy.encode(observations), _NO_THETA)

    def act(self, observations: FloatArray) -> IntArray:
        """An action for each of the observations (B, features)."""
        z = self.expectation(observations)
        return self.policy.greedy(z) if self.greedy else self.policy.sample(z, self._rng)
