"""An episode through independent parts: qiskit-ibm-runtime's sampler in the place of our noise."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from scipy.stats import chi2, norm

from qcompile.deploy.deployment import Deployment
from qcompile.device import IDEAL
from qcompile.execution import OfflineExecutor
from qcompile.passes import compile
from qcompile.policy import load_policy

pytest.importorskip("qiskit_ibm_runtime")

STEPS, SHOTS = 25, 8192
NO_THETA = np.zeros(0)
FALSE_ALARM = 1e-6


def test_an_episode_on_fake_lima_agrees_with_our_noise_on_every_qubit() -> None:
    """Ones of N shots have mean N p and variance N p (1 - p): qubit by qubit, and all together."""
    deployment = Deployment(
        load_policy("cartpole"), "qiskit:FakeLimaV2", shots=SHOTS, mitigation="readout", seed=3
    )
    executor, executable = deployment.executor, deployment.executable
    played: list[tuple[Any, Any]] = []
    run = executor.run

    def recorded(made: Any, x: Any, theta: Any, shots: int) -> Any:
        ones = run(made, x, theta, shots)
        if made is executable:
            played.append((x, ones))
        return ones

    executor.run = recorded  # type: ignore[method-assign]
    environment = gymnasium.make("CartPole-v1")
    seen, _ = environment.reset(seed=3)
    for _ in range(STEPS):
        action = deployment.act(np.asarray(seen, dtype=float)[None])[0]
        seen, _, terminated, _, _ = environment.step(int(action))
        assert not terminated, "a policy that balances lasts longer than this"
    environment.close()

    x, ones = (np.concatenate(parts) for parts in zip(*played, strict=True))
    assert ones.shape == (STEPS, 4)
    ours, perfect = (
        (1 - OfflineExecutor(device).expectation(made, x, NO_THETA)) / 2
        for device, made in ((executor.device, executable), (IDEAL, compile(executable.source)))
    )
    ours_off, perfect_off = (
        (ones - SHOTS * p) / np.sqrt(SHOTS * p * (1 - p)) for p in (ours, perfect)
    )
    assert np.abs(ours_off).max() < norm.isf(FALSE_ALARM / ours_off.size / 2)
    bound = chi2.isf(FALSE_ALARM / 4, STEPS)
    assert ((ours_off**2).sum(axis=0) < bound).all()
    assert ((perfect_off**2).sum(axis=0) > bound).all(), "perfect qubits would pass as well"
