"""Runs that measure ahead: the same episodes as decision by decision, and their results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import NormalizeReward

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.device import load_device
from qcompile.errors import OptionError
from qcompile.execution import Executor, OfflineExecutor, Prepared, TwinExecutor
from qcompile.mitigation import calibrate
from qcompile.passes import Executable

Make = Callable[..., Any]
SETTINGS: dict[str, Any] = {"shots": 24, "mitigation": "readout", "seed": 3, "max_steps": 40}


class Counting(Executor):
    """A noise model that hides its expectations, as a sampler or a machine has none."""

    def __init__(self, device: Any):
        self._model = OfflineExecutor(device, 5)
        self.device, self.kind = device, self._model.kind

    def prepare(self, executable: Executable) -> Prepared:
        known = self._model.prepare(executable)

        class Hidden(Prepared):
            shots_only = ("It only has shots.",)

            def ones(self, x: Any, theta: Any, shots: int, rng: Any = None) -> Any:
                return known.ones(x, theta, shots)

        return Hidden(executable)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("speculate", [2, 7, "auto"])
def test_the_episodes_are_those_of_one_decision_a_job(
    cartpole: Make, deploy: Make, speculate: int | str, copies: int
) -> None:
    policy = cartpole()
    device = "fake_toronto" if copies > 1 else "fake_lima"
    alone, together = (
        play(deploy(policy, device, speculate=d, copies=copies, **SETTINGS), 5)
        for d in (1, speculate)
    )
    assert together.episodes == alone.episodes
    assert together.decisions == alone.decisions == alone.measured_rows
    assert together.env_steps == alone.env_steps
    assert together.load.jobs < alone.load.jobs
    assert together.measured_rows > together.decisions


def test_every_row_was_measured_in_the_copy_of_its_episode(cartpole: Make, deploy: Make) -> None:
    """5 episodes in 2 copies, D = 4: the even ones have 3 x 4 executions in the first job."""
    deployment = deploy(cartpole(), "fake_toronto", speculate=4, copies=2, **SETTINGS)
    run = play(deployment, 5)
    assert max(run.programs) == 3 * 4
    assert run.load.executions == sum(n * jobs for n, jobs in run.programs.items()) * 24


def test_it_is_told(cartpole: Make, deploy: Make) -> None:
    summary = play(deploy(cartpole(), "fake_lima", speculate=4, **SETTINGS), 3).summary()
    assert summary["speculate"] == 4
    assert summary["decisions"] == sum(episode["length"] for episode in summary["episodes"])
    assert summary["decisions"] < summary["measured_rows"] < 4 * summary["decisions"]
    assert summary["mean_reward"] == np.mean([e["reward"] for e in summary["episodes"]])


def test_without_shot_noise_there_is_nothing_to_predict(cartpole: Make, deploy: Make) -> None:
    deployment = deploy(cartpole(), speculate="auto")
    assert deployment.settings.speculate == 1
    run = play(deployment, 2)
    assert run.decisions == run.measured_rows


def test_a_stopped_run_gives_no_mean(cartpole: Make, deploy: Make) -> None:
    """The episodes that end first are those measured as predicted."""

    def stop(episode: Any) -> None:
        raise KeyboardInterrupt

    for speculate, has_mean in ((1, True), (3, False)):
        deployment = deploy(cartpole(), "fake_lima", speculate=speculate, **SETTINGS)
        summary = play(deployment, 4, on_episode=stop).summary()
        assert len(summary["episodes"]) == 1
        assert (summary["mean_reward"] is not None) is has_mean
        assert (summary["std_reward"] is not None) is has_mean
        assert summary["ci95"] is None
        assert summary["solved"] is None


def test_running_statistics_are_refused_where_steps_are_measured_ahead(
    stubborn: Make, deploy: Make
) -> None:
    gymnasium.register(
        "Scaled-v0",
        lambda: NormalizeReward(gymnasium.make("CartPole-v1")),
        disable_env_checker=True,
    )
    try:
        policy = stubborn("Scaled-v0", 4, 2)
        play(deploy(policy, shots=10), 1)
        with pytest.raises(OptionError, match="Scaled-v0 keeps running"):
            play(deploy(policy, shots=10, speculate=2), 1)
    finally:
        del gymnasium.registry["Scaled-v0"]


@pytest.mark.parametrize(("speculate", "words"), [(0, "from 1 to 64"), (65, "from 1 to 64")])
def test_a_depth_out_of_range_is_refused(
    cartpole: Make, deploy: Make, speculate: int, words: str
) -> None:
    with pytest.raises(OptionError, match=words):
        deploy(cartpole(), shots=10, speculate=speculate)


OBSERVED = np.random.default_rng(1).normal(size=(400, 4)) / 4
ROWS = Rows(np.arange(400) % 7, np.arange(400))


def test_what_has_no_expectations_is_predicted_by_its_noise_model(cartpole: Make) -> None:
    """And by a calibration of that model: one of the machine undoes what the model does not do."""
    device = load_device("fake_lima")
    of_another_day = calibrate(OfflineExecutor(device, 8), np.arange(5), 50, parts=["readout"])
    machine = Deployment(cartpole(), Counting(device), shots=64, seed=9, calibration=of_another_day)
    model = Deployment(cartpole(), device, shots=None, seed=9, mitigation="readout")
    np.testing.assert_array_equal(machine.predict(OBSERVED, ROWS), model.act(OBSERVED, ROWS))
    run = play(Deployment(cartpole(), Counting(device), speculate=3, **SETTINGS), 3)
    assert run.decisions < run.measured_rows
    assert run.load.jobs < 40


def test_a_measured_response_predicts_as_its_twin(cartpole: Make) -> None:
    device = load_device("fake_lima")
    known = calibrate(OfflineExecutor(device, 8), np.arange(5), 60)
    machine = Deployment(cartpole(), Counting(device), shots=64, seed=9, calibration=known)
    twin = Deployment(cartpole(), TwinExecutor(known), shots=None, seed=9, mitigation="readout")
    np.testing.assert_array_equal(machine.predict(OBSERVED, ROWS), twin.act(OBSERVED, ROWS))
    model = Deployment(cartpole(), device, shots=None, seed=9, mitigation="readout")
    assert (machine.predict(OBSERVED, ROWS) != model.act(OBSERVED, ROWS)).any()


def test_a_prediction_draws_nothing(cartpole: Make, deploy: Make) -> None:
    """The same counts follow, whether or not something was predicted before."""
    first, second = (deploy(cartpole(), "fake_lima", **SETTINGS) for _ in range(2))
    second.predict(OBSERVED, ROWS)
    np.testing.assert_array_equal(first.act(OBSERVED, ROWS), second.act(OBSERVED, ROWS))
    np.testing.assert_array_equal(first.expectation(OBSERVED), second.expectation(OBSERVED))
