"""Playing: episodes against stepping by hand, repeatability, and refusals."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from qcompile.deploy.filming import Frame
from qcompile.deploy.play import MAX_EPISODES, Episode, play
from qcompile.device import load_device
from qcompile.errors import CalibrationError, CountsError, EnvironmentMismatchError
from qcompile.noise import usable

Make = Callable[..., Any]

SCALE = np.array([1.0, 1.0, 4.0, 2.0])
WEIGHTS = np.array([0.5, -0.8, 3.0, -0.5])


def by_hand(observation: np.ndarray) -> int:
    """The more probable action of `cartpole`, from sin(arctan(u)) = u / sqrt(1 + u^2)."""
    u = SCALE * observation
    return int((WEIGHTS * u / np.sqrt(1 + u**2)).sum() > 0)


def test_episodes_are_those_stepped_by_hand(cartpole: Make, deploy: Make) -> None:
    """Episode i resets with seed + i; the expected actions come from a formula."""
    result = play(deploy(cartpole(), greedy=True, seed=40), 5)
    expected = []
    for seed in range(40, 45):
        environment = gymnasium.make("CartPole-v1")
        observation, _ = environment.reset(seed=seed)
        reward, length, done = 0.0, 0, False
        while not done:
            observation, paid, terminated, truncated, _ = environment.step(by_hand(observation))
            reward, length, done = reward + float(paid), length + 1, terminated or truncated
        environment.close()
        expected.append(Episode(seed, reward, length))
    assert result.episodes == expected
    assert len({episode.length for episode in expected}) > 1, "lockstep is not tried"
    assert result.env_steps == sum(episode.length for episode in expected)
    assert result.load.jobs == max(episode.length for episode in expected)
    assert not result.interrupted


def test_lockstep_changes_nothing_for_a_greedy_policy_without_shot_noise(
    cartpole: Make, deploy: Make
) -> None:
    device = "fake_lima"
    together = play(deploy(cartpole(), device, greedy=True, seed=7), 4).episodes
    alone = [
        play(deploy(cartpole(), device, greedy=True, seed=seed), 1).episodes[0]
        for seed in range(7, 11)
    ]
    assert together == alone


@pytest.mark.parametrize("settings", [{"shots": 64}, {"shots": 64, "greedy": True}, {}])
def test_a_run_repeats_exactly(settings: dict[str, Any], cartpole: Make, deploy: Make) -> None:
    def run(seed: int) -> list[tuple[float, int]]:
        policy = replace(cartpole(), weights=cartpole().weights / 4)
        deployment = deploy(policy, "fake_lima", mitigation="readout", seed=seed, **settings)
        return [(e.reward, e.length) for e in play(deployment, 6).episodes]

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_two_deployments_sample_the_same_actions(cartpole: Make, deploy: Make) -> None:
    observations = np.random.default_rng(0).normal(size=(100, 4)) / 10
    settings: dict[str, Any] = {"shots": 16, "mitigation": "readout"}
    drawn = [
        deploy(cartpole(), "fake_lima", seed=s, **settings).act(observations) for s in (3, 3, 4)
    ]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert (drawn[0] != drawn[2]).any()


def test_exact_expectations_are_the_closed_form(cartpole: Make, deploy: Make) -> None:
    observations = np.random.default_rng(1).normal(size=(20, 4))
    u = SCALE * observations
    z = deploy(cartpole()).expectation(observations)
    np.testing.assert_allclose(z, -u / np.sqrt(1 + u**2), atol=1e-12)


def test_mitigation_brings_expectations_nearer(cartpole: Make, deploy: Make) -> None:
    """The readout of fake_lima errs by a few percent, its gates ten times less."""
    observations = np.random.default_rng(2).normal(size=(200, 4))
    u = SCALE * observations
    true = -u / np.sqrt(1 + u**2)
    raw, mitigated = (
        np.abs(
            deploy(cartpole(), "fake_lima", mitigation=m).expectation(observations) - true
        ).mean()
        for m in ("none", "readout")
    )
    assert mitigated < raw / 2


def test_ctrl_c_keeps_finished_episodes(cartpole: Make, deploy: Make) -> None:
    finished: list[Episode] = []

    def stop(episode: Episode) -> None:
        finished.append(episode)
        if len(finished) == 3:
            raise KeyboardInterrupt

    deployment = deploy(cartpole(), shots=128, seed=40)
    result = play(deployment, 8, on_episode=stop)
    assert result.interrupted
    assert result.episodes == sorted(finished, key=lambda e: e.seed)
    assert len(result.episodes) == 3
    summary = result.summary()
    assert summary["interrupted"] is True
    assert summary["mean_reward"] == pytest.approx(np.mean([e.reward for e in finished]))


def test_copies_play_the_same_episodes_where_nothing_is_random(
    cartpole: Make, deploy: Make
) -> None:
    alone, together = (play(deploy(cartpole(), greedy=True, copies=n), 3) for n in (1, 2))
    assert together.episodes == alone.episodes


def test_the_most_important_circuit_has_the_best_qubit(cartpole: Make, deploy: Make) -> None:
    deployment = deploy(cartpole(), "fake_lima")
    best = deployment.policy.importance.argmax()
    assert deployment.executable.qubits[best] == usable(load_device("fake_lima"))[0]


def test_rewards_of_a_known_environment(stubborn: Make, deploy: Make) -> None:
    """Each of the copies of the clock is in its first episode: 11 + 12 + 13 and 3 half actions."""
    result = play(deploy(stubborn("Clock-v0", 2, 3, choice=2)), 3)
    assert result.episodes == [Episode(seed, 39.0, 3) for seed in range(3)]


def test_an_unknown_environment_gets_the_nearest_names(stubborn: Make, deploy: Make) -> None:
    with pytest.raises(
        EnvironmentMismatchError, match="Unknown environment 'CartPoll-v1'"
    ) as caught:
        play(deploy(stubborn("CartPoll-v1", 4, 2)), 1)
    assert "CartPole-v1" in str(caught.value)
    with pytest.raises(EnvironmentMismatchError, match="LunarLander-v3"):
        play(deploy(stubborn("LunarLander-v2", 8, 4)), 1)


@pytest.mark.parametrize(
    ("name", "features", "actions", "message"),
    [
        ("Pendulum-v1", 3, 2, "Pendulum-v1 acts in Box"),
        ("FrozenLake-v1", 17, 4, "reads feature 16; observations of FrozenLake-v1 have 16"),
        ("CartPole-v1", 5, 2, "reads feature 4; observations of CartPole-v1 have 4 features"),
        ("CartPole-v1", 4, 3, "has 3 actions; CartPole-v1 has 2"),
        ("Acrobot-v1", 6, 2, "has 2 actions; Acrobot-v1 has 3"),
    ],
)
def test_an_environment_that_does_not_fit_is_refused(
    name: str, features: int, actions: int, message: str, stubborn: Make, deploy: Make
) -> None:
    with pytest.raises(EnvironmentMismatchError, match=message):
        play(deploy(stubborn(name, features, actions)), 1)


def test_a_policy_may_read_fewer_features_than_there_are(stubborn: Make, deploy: Make) -> None:
    assert len(play(deploy(stubborn("CartPole-v1", 2, 2)), 2).episodes) == 2


@pytest.mark.parametrize("episodes", [0, -1, MAX_EPISODES + 1])
def test_the_number_of_episodes_has_limits(episodes: int, cartpole: Make, deploy: Make) -> None:
    with pytest.raises(CountsError, match=f"number of episodes cannot be {episodes}"):
        play(deploy(cartpole()), episodes)


def test_settings_of_a_deployment_are_checked(cartpole: Make, deploy: Make) -> None:
    with pytest.raises(CountsError, match="0 shots cannot be run"):
        deploy(cartpole(), shots=0)
    with pytest.raises(
        CalibrationError, match=r"Unknown mitigation 'magic'\.\n  Known: none, readout"
    ):
        deploy(cartpole(), mitigation="magic")


def test_the_first_episode_is_filmed(stubborn: Make, deploy: Make) -> None:
    """A frame for every step of the first episode, which ends soon."""
    pytest.importorskip("pygame")
    frames: list[Frame] = []
    result = play(deploy(stubborn("CartPole-v1", 4, 2)), 2, on_frame=frames.append)
    assert [frame.step for frame in frames] == list(range(1, result.episodes[0].length + 1))
    assert {frame.picture.shape for frame in frames} == {(400, 600, 3)}
    assert {frame.rate for frame in frames} == {50.0}  # CartPole's render_fps
    assert frames[-1].reward == result.episodes[0].reward


def test_exact_shots_are_calibrated_exactly(cartpole: Make, deploy: Make) -> None:
    """Nothing is executed and nothing scatters: neither in the calibration nor in the circuits."""
    observations = np.random.default_rng(5).normal(size=(50, 4))
    settings: dict[str, Any] = {"mitigation": "readout", "greedy": True}
    found = [deploy(cartpole(), "fake_lima", seed=s, **settings) for s in (1, 2)]
    z = [deployment.expectation(observations) for deployment in found]
    np.testing.assert_array_equal(z[0], z[1])
    u = SCALE * observations
    # The noise of the gates is left, a few parts in a thousand, and not the readout's hundredths.
    raw = deploy(cartpole(), "fake_lima").expectation(observations)
    truth = -u / np.sqrt(1 + u**2)
    assert np.abs(z[0] - truth).max() < 0.01 < np.abs(raw - truth).max()
    summary = play(found[0], 2).summary()
    assert (summary["executions"], summary["qpu_seconds_estimate"]) == (0, None)


def test_an_environment_that_names_a_module_imports_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stubborn: Make, deploy: Make
) -> None:
    (tmp_path / "trojan_horse.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(EnvironmentMismatchError, match="would import a module"):
        play(deploy(stubborn("trojan_horse:CartPole-v1", 4, 2)), 1)
    assert "trojan_horse" not in sys.modules
    with pytest.raises(SystemExit, match="imported"):
        gymnasium.make("trojan_horse:CartPole-v1")
