"""An episode through independent code: qiskit-ibm-runtime's sampler in place of our noise."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from scipy.stats import chi2, norm

from qcompile.deploy.deployment import Deployment
from qcompile.device import IDEAL
from qcompile.execution import OfflineExecutor, Prepared, open_executor
from qcompile.passes import Executable, compile
from qcompile.policy import load_policy

pytest.importorskip("qiskit_ibm_runtime")

STEPS, SHOTS = 25, 8192
NO_THETA = np.zeros(0)
FALSE_ALARM = 1e-6


def test_an_episode_on_fake_lima_agrees_with_our_noise_on_every_qubit() -> None:
    """Ones of N shots have mean N p and variance N p (1 - p): qubit by qubit, and all together."""
    executor = open_executor("qiskit:FakeLimaV2", np.random.SeedSequence(3).spawn(2)[0])
    prepare, played = executor.prepare, list[tuple[Any, Any]]()

    def recorded(executable: Executable) -> Prepared:
        prepared = prepare(executable)
        ones = prepared.ones

        def noted(x: Any, theta: Any, shots: int, rng: Any = None) -> Any:
            played.append((x, ones(x, theta, shots, rng)))
            return played[-1][1]

        prepared.ones = noted  # type: ignore[method-assign]
        return prepared

    executor.prepare = recorded  # type: ignore[method-assign]
    deployment = Deployment(
        load_policy("cartpole"), executor, shots=SHOTS, mitigation="readout", seed=3
    )
    executable = deployment.executable
    played.clear()  # of the calibration
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
    all_qubits = chi2.isf(FALSE_ALARM, perfect_off.size)
    assert (perfect_off**2).sum() > 2 * all_qubits, "perfect qubits would pass as well"
