"""Policies of circuits of several qubits on samplers, in several copies, and measured ahead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wide_policies import OBSERVATIONS, ideal, policy

import qcompile
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.measurement import Measurement
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.execution import OfflineExecutor, open_executor
from qcompile.mitigation import calibrate


def quiet() -> qcompile.Device:
    """Of 27 qubits with readout errors, each its own, and no other noise."""
    device = qcompile.load_device("fake_toronto")
    qubits = [
        {**qubit.model_dump(), "gates": {}, "p10": 0.01 + 0.002 * i, "p01": 0.08 - 0.002 * i}
        for i, qubit in enumerate(device.qubits)
    ]
    couplings = [{**each.model_dump(), "error": 0.0, "length_ns": 0.0} for each in device.couplings]
    values = device.model_dump() | {"qubits": qubits, "couplings": couplings}
    return qcompile.Device.model_validate(values)


@pytest.mark.parametrize("split", [False, True])
def test_the_readout_of_every_copy_is_undone(split: bool) -> None:
    """Where only the readout errs, the ideal products come back, whatever the copy."""
    device = quiet()
    deployment = Deployment(policy(), device, shots=None, copies=3, split=split)
    assert deployment.executable.round_count == 1
    found = deployment.expectation(np.tile(OBSERVATIONS, (2, 1)))
    np.testing.assert_allclose(found, np.tile(ideal(), (2, 1)), atol=1e-9)
    plain = Deployment(policy(), device, shots=None, copies=3, split=split, mitigation="none")
    assert np.abs(plain.expectation(OBSERVATIONS) - ideal()).max() > 0.05


def test_split_shots_are_shared_out() -> None:
    """Of 100 shots the first place of three has 34: estimates have the law of all 100."""
    device = quiet()
    settings = {"shots": 100, "copies": 3, "split": True, "mitigation": "none", "seed": 4}
    exact = Deployment(policy(), device, **settings | {"shots": None})
    rows = np.repeat(OBSERVATIONS[:1], 3000, axis=0)
    found = Deployment(policy(), device, **settings)
    assert found.load(found.executions(Rows.of(3000))).executions == 3000 * 34
    z, wanted = found.expectation(rows), exact.expectation(OBSERVATIONS[:1])[0]
    sigma = np.sqrt((1 - wanted**2) / (100 * 3000))
    assert (np.abs(z.mean(axis=0) - wanted) < 5 * sigma).all()
    np.testing.assert_allclose(z.std(axis=0), np.sqrt((1 - wanted**2) / 100), rtol=0.15)


def test_an_observable_listed_twice_is_mitigated_twice() -> None:
    twice = replace(policy().program, observables=((0, 1), (0, 1), (2,)))
    executor = OfflineExecutor(quiet(), 0)
    settings = RunSettings(shots=None).resolved(executor.device)
    measure = Measurement(twice, executor, settings)
    found = measure(policy().encode(OBSERVATIONS), policy().theta)
    np.testing.assert_allclose(found, ideal()[:, [0, 0, 2]], atol=1e-9)


@pytest.mark.parametrize("copies", [1, 2])
def test_a_sampler_plays_as_the_noise_model_measures(copies: int) -> None:
    """Mitigated estimates of qiskit:FakeTorontoV2 agree with the exact ones of its noise."""
    settings = RunSettings.of(None, shots=4000, seed=2, copies=copies, calibration_shots=100_000)
    found = Deployment(policy(), "qiskit:FakeTorontoV2", settings)
    exact = Deployment(policy(), "fake_toronto", RunSettings.of(settings, shots=None))
    observations = np.tile(OBSERVATIONS, (5, 1))
    difference = found.expectation(observations) - exact.expectation(observations)
    assert np.abs(difference).max() < 5 * 1.4 / np.sqrt(4000)
    assert np.abs(difference.mean(axis=0)).max() < 4 * 1.4 / np.sqrt(4000 * 20) + 0.01


@pytest.mark.parametrize("depth", [3, "auto"])
def test_measuring_ahead_through_a_sampler(depth: int | str) -> None:
    """With a calibration that has response curves, which no twin of wide circuits can use."""
    known = calibrate(open_executor("qiskit:FakeLimaV2", 1), range(5), 2000)
    settings = {"shots": 64, "seed": 5, "max_steps": 8, "calibration": known}
    run = play(Deployment(policy(), "qiskit:FakeLimaV2", speculate=depth, **settings), 2)
    assert [episode.length for episode in run.episodes] == [8, 8]
    assert run.load.jobs < 8
    assert run.decisions == 16


def test_the_calibration_may_have_other_qubits_too() -> None:
    known = calibrate(OfflineExecutor(qcompile.load_device("fake_lima"), 3), range(5), None)
    found = Deployment(policy(), "fake_lima", shots=None, calibration=known)
    fresh = Deployment(policy(), "fake_lima", shots=None)
    np.testing.assert_allclose(
        found.expectation(OBSERVATIONS), fresh.expectation(OBSERVATIONS), atol=1e-9
    )
