"""Episodes in lockstep, and the measurement of a program."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from qcompile.deploy.environments import make_environments
from qcompile.deploy.lockstep import Episode, lockstep
from qcompile.deploy.measurement import Measurement
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.device import load_device
from qcompile.errors import CalibrationError, CountsError, OptionError
from qcompile.execution import Executor, OfflineExecutor, TwinExecutor
from qcompile.mitigation import calibrate, response_mitigation
from qcompile.policy.layouts import parallel


def alone(seed: int) -> tuple[list[np.ndarray], float]:
    """CartPole pushed left and right in turn: the observations before each step, and the reward."""
    environment = gymnasium.make("CartPole-v1")
    seen, total, done, observations = environment.reset(seed=seed)[0], 0.0, False, []
    while not done:
        observations.append(seen)
        seen, reward, terminated, truncated, _ = environment.step(len(observations) % 2)
        total, done = total + float(reward), terminated or truncated
    environment.close()
    return observations, total


def test_every_step_serves_all_that_live_in_the_order_of_their_seeds() -> None:
    """Against each episode played alone: rows, counts and the order in which they finish."""
    count, first = 7, 50
    expected = [alone(first + i) for i in range(count)]
    lengths = [len(observations) for observations, _ in expected]
    assert len(set(lengths)) > 2
    given: list[np.ndarray] = []
    numbers: list[Rows] = []
    finished: list[Episode] = []

    def act(observations: np.ndarray, rows: Rows) -> np.ndarray:
        assert observations.dtype == np.float64
        given.append(observations.copy())
        numbers.append(rows)
        return np.full(len(observations), len(given) % 2)

    environments = make_environments("CartPole-v1", count)
    lockstep(act, environments, first, on_episode=finished.append)
    for environment in environments:
        environment.close()
    assert [rows.episode.tolist() for rows in numbers] == [
        [i for i in range(count) if lengths[i] > step] for step in range(max(lengths))
    ]
    assert [set(rows.decision.tolist()) for rows in numbers] == [{k} for k in range(max(lengths))]
    for step, rows in enumerate(given):
        alive = [seen[step] for seen, _ in expected if len(seen) > step]
        np.testing.assert_array_equal(rows, np.stack(alive))
    order = sorted(range(count), key=lambda i: (lengths[i], i))
    assert finished == [Episode(first + i, expected[i][1], lengths[i]) for i in order]


def test_no_episode_is_longer_than_asked() -> None:
    """CartPole lives longer than three steps, each of which earns 1."""
    finished: list[Episode] = []
    environments = make_environments("CartPole-v1", 2)
    lockstep(
        lambda observations, rows: np.zeros(len(observations), dtype=int),
        environments,
        50,
        max_steps=3,
        on_episode=finished.append,
    )
    for environment in environments:
        environment.close()
    assert finished == [Episode(50, 3.0, 3), Episode(51, 3.0, 3)]


PROGRAM, _ = parallel(3, 1)
X = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 3))
THETA = np.array([0.3, -1.2, 2.0])
TRUE = -np.sin(X) * np.cos(THETA) - np.cos(X) ** 2 * np.sin(THETA)


def measurement(executor: Executor, **changes: Any) -> Measurement:
    """Exact and unmitigated, except for these settings."""
    settings = RunSettings(**{"shots": None, "mitigation": "none", **changes})
    return Measurement(PROGRAM, executor, settings.resolved(executor.device))


def measured(device: str = "ideal", **settings: Any) -> np.ndarray:
    executor = OfflineExecutor(load_device(device), settings.pop("seed", None))
    return measurement(executor, **settings)(X, THETA)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_an_exact_measurement_is_the_closed_form(level: int) -> None:
    np.testing.assert_allclose(measured(level=level), TRUE, atol=1e-12)


def test_shots_scatter_as_a_binomial_law() -> None:
    """120 numbers; the mean of squared deviations in units of (1 - z^2) / n is 1 +- 0.13."""
    shots = 400
    z = measured(shots=shots, seed=1)
    np.testing.assert_allclose(z * shots / 2, np.round(z * shots / 2), atol=1e-9)
    pulls = (z - TRUE) / np.sqrt((1 - TRUE**2) / shots)
    assert abs(pulls.mean()) < 5 / np.sqrt(120)
    assert (pulls**2).mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 120))


def test_a_measurement_repeats_with_its_seed() -> None:
    settings: dict[str, Any] = {"device": "fake_lima", "shots": 64, "mitigation": "readout"}
    first, again, other = (measured(**settings, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_one_measurement_serves_any_theta() -> None:
    """Compiled once: theta is given with each call."""
    measure = measurement(OfflineExecutor(load_device("ideal")))
    for theta in (np.zeros(3), THETA, -THETA):
        expected = -np.sin(X) * np.cos(theta) - np.cos(X) ** 2 * np.sin(theta)
        np.testing.assert_allclose(measure(X, theta), expected, atol=1e-12)


def test_readout_mitigation_undoes_what_the_readout_does() -> None:
    raw, mitigated = (measured("fake_lima", mitigation=m) - TRUE for m in ("none", "readout"))
    assert np.abs(mitigated).max() < 0.01 < np.abs(raw).max()


@pytest.mark.parametrize("rows", [0, 1, 5, 6])
@pytest.mark.parametrize("copies", [1, 2, 3, 40])
def test_copies_measure_the_same_rows(copies: int, rows: int) -> None:
    measure = measurement(OfflineExecutor(load_device("ideal")), copies=copies)
    z = measure(X[:rows], THETA)
    assert z.shape == (rows, 3)
    np.testing.assert_allclose(z, TRUE[:rows], atol=1e-12)


def test_copies_are_mitigated_on_their_own_qubits() -> None:
    settings: dict[str, Any] = {"device": "fake_toronto", "copies": 8, "shots": 100_000}
    raw, mitigated = (measured(**settings, mitigation=m) - TRUE for m in ("none", "readout"))
    assert np.abs(mitigated).mean() < 0.01 < np.abs(raw).mean()
    assert measured(**settings).shape == TRUE.shape


def test_a_response_or_predistorted_angles_leave_less_than_the_readout_alone() -> None:
    settings: dict[str, Any] = {"device": "fake_toronto"}
    by_readout, by_response, by_predistortion = (
        np.abs(measured(**settings, **chosen) - TRUE).max()
        for chosen in ({"mitigation": "readout"}, {"mitigation": "response"}, {"predistort": True})
    )
    assert by_response < 1e-5 < 2e-3 < by_readout
    assert by_predistortion < by_readout  # what the device cannot show is left


def test_a_calibration_that_is_given_is_used() -> None:
    device = load_device("fake_lima")
    calibration = calibrate(OfflineExecutor(device, 3), np.arange(5), 1000)
    executor, mitigated = OfflineExecutor(device, 1), {"shots": 100, "mitigation": "response"}
    measure = measurement(executor, calibration=calibration, **mitigated)
    assert measure.calibration_load.jobs == 0
    raw = measurement(OfflineExecutor(device, 1), shots=100)(X, THETA)
    by_hand = response_mitigation(calibration, measure.executable).apply(raw)
    np.testing.assert_array_equal(measure(X, THETA), by_hand)
    twin = TwinExecutor(calibration, 5)
    assert measurement(twin, **mitigated).calibration_load.jobs == 0
    with pytest.raises(CalibrationError, match="belongs to fake_lima; the backend is fake_lagos"):
        measured("fake_lagos", mitigation="readout", calibration=calibration)


def test_a_wrong_measurement_is_refused() -> None:
    with pytest.raises(OptionError, match="cannot be combined"):
        measured(predistort=True, mitigation="response")
    with pytest.raises(CountsError):
        measured(shots=0)
    with pytest.raises(CalibrationError, match="Unknown mitigation 'magic'"):
        measured(mitigation="magic")
