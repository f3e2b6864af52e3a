"""Playing: episodes against stepping by hand, repeatability, and what a summary says."""

from __future__ import annotations

import math
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from scipy import stats

from qcompile.device import load_device
from qcompile.errors import CalibrationError, CountsError, EnvironmentMismatchError
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel
from qcompile.rl.environments import make_environments, reward_threshold
from qcompile.rl.evaluate import MAX_EPISODES, Deployment, Episode, RunResult, bootstrap_ci95, play

SCALE = np.array([1.0, 1.0, 4.0, 2.0])
WEIGHTS = np.array([0.5, -0.8, 3.0, -0.5])


def cartpole(copies: int = 1) -> Policy:
    """Pushes mostly towards the side the pole leans to: y = -sin(x), action 1 is to the right."""
    program, feature = parallel(4, copies)
    right = np.tile(-WEIGHTS / copies, copies)
    return Policy(
        "leaning",
        "CartPole-v1",
        Encoder("arctan", np.array(feature), np.tile(SCALE, copies)),
        program,
        np.zeros(4 * copies),
        np.stack([-right, right]),
        np.zeros(2),
    )


def by_hand(observation: np.ndarray) -> int:
    """The more probable action of `cartpole`, from sin(arctan(u)) = u / sqrt(1 + u^2)."""
    u = SCALE * observation
    return int((WEIGHTS * u / np.sqrt(1 + u**2)).sum() > 0)


def stubborn(name: str, features: int, actions: int, choice: int = 0) -> Policy:
    """Takes the same action whatever it sees."""
    program, feature = parallel(features, 1)
    bias = np.zeros(actions)
    bias[choice] = 100.0
    return Policy(
        "stubborn",
        name,
        Encoder("arctan", np.array(feature), np.ones(features)),
        program,
        np.zeros(features),
        np.zeros((actions, features)),
        bias,
    )


def deploy(policy: Policy, backend: str = "ideal", **settings: Any) -> Deployment:
    return Deployment(policy, load_device(backend), **settings)


def test_episodes_are_those_stepped_by_hand() -> None:
    """Episode i resets with seed + i; the actions come from a formula of their own."""
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


def test_lockstep_changes_nothing_for_a_greedy_policy_without_shot_noise() -> None:
    device = "fake_lima"
    together = play(deploy(cartpole(), device, greedy=True, seed=7), 4).episodes
    alone = [
        play(deploy(cartpole(), device, greedy=True, seed=seed), 1).episodes[0]
        for seed in range(7, 11)
    ]
    assert together == alone


@pytest.mark.parametrize("settings", [{"shots": 64}, {"shots": 64, "greedy": True}, {}])
def test_a_run_repeats_exactly(settings: dict[str, Any]) -> None:
    def run(seed: int) -> list[tuple[float, int]]:
        policy = replace(cartpole(), weights=cartpole().weights / 4)
        deployment = deploy(policy, "fake_lima", mitigation="readout", seed=seed, **settings)
        return [(e.reward, e.length) for e in play(deployment, 6).episodes]

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_two_deployments_sample_the_same_actions() -> None:
    observations = np.random.default_rng(0).normal(size=(100, 4)) / 10
    settings: dict[str, Any] = {"shots": 16, "mitigation": "readout"}
    drawn = [
        deploy(cartpole(), "fake_lima", seed=s, **settings).act(observations) for s in (3, 3, 4)
    ]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert (drawn[0] != drawn[2]).any()


def test_exact_expectations_are_the_closed_form() -> None:
    observations = np.random.default_rng(1).normal(size=(20, 4))
    u = SCALE * observations
    z = deploy(cartpole()).expectation(observations)
    np.testing.assert_allclose(z, -u / np.sqrt(1 + u**2), atol=1e-12)


def test_mitigation_brings_expectations_nearer() -> None:
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


def test_ctrl_c_keeps_finished_episodes() -> None:
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


def test_an_interrupted_step_is_counted_like_its_job() -> None:
    """The job of the last step was run: its executions are those of every step."""

    def stop(episode: Episode) -> None:
        raise KeyboardInterrupt

    result = play(deploy(stubborn("Clock-v0", 2, 3), shots=100), 2, on_episode=stop)
    assert (result.load.jobs, result.env_steps, result.total_load.executions) == (3, 6, 600)


def test_an_interrupted_run_without_episodes_has_no_mean() -> None:
    summary = RunResult(deploy(cartpole()), 5, interrupted=True).summary()
    for key in ("mean_reward", "std_reward", "ci95", "solved"):
        assert summary[key] is None
    assert summary["episodes"] == []


DOCUMENTED = """policy environment backend kind shots mitigation level seed episodes mean_reward
std_reward ci95 solved gates_per_circuit circuits_per_step rounds_per_step executions
qpu_seconds_estimate env_steps wall_seconds""".split()  # noqa: SIM905


def test_a_summary_has_what_is_documented_and_counts_by_hand() -> None:
    """Eight circuits on four of the five qubits of ibm_lima are two rounds.

    The calibration of four qubits has six patterns.
    """
    deployment = deploy(cartpole(2), "ibm_lima", shots=128, mitigation="readout", seed=9)
    result = play(deployment, 3)
    summary = result.summary()
    assert set(summary) >= set(DOCUMENTED)
    lengths = [episode["length"] for episode in summary["episodes"]]
    rewards = [episode["reward"] for episode in summary["episodes"]]
    assert [set(e) for e in summary["episodes"]] == [{"seed", "reward", "length"}] * 3
    assert [e["seed"] for e in summary["episodes"]] == [9, 10, 11]
    assert rewards == [float(n) for n in lengths], "CartPole pays 1 a step"
    executions = sum(lengths) * 2 * 128 + 6 * 8192
    expected = {
        "policy": "leaning",
        "environment": "CartPole-v1",
        "backend": "ibm_lima",
        "kind": "noise-model",
        "shots": 128,
        "mitigation": "readout",
        "level": 2,
        "seed": 9,
        "solved": None,
        "gates_per_circuit": {"sx": 2, "rz": 1, "x": 0, "rx": 0},
        "circuits_per_step": 8,
        "rounds_per_step": 2,
        "executions": executions,
        "env_steps": sum(lengths),
    }
    assert {key: summary[key] for key in expected} == expected
    assert summary["mean_reward"] == pytest.approx(sum(rewards) / 3)
    mean = sum(rewards) / 3
    variance = sum((r - mean) ** 2 for r in rewards) / 3
    assert summary["std_reward"] == pytest.approx(variance**0.5)
    seconds = 2 * (max(lengths) + 1) + 0.00035 * executions
    assert summary["qpu_seconds_estimate"] == pytest.approx(seconds)
    assert summary["wall_seconds"] > 0


@pytest.mark.parametrize(("copies", "programs"), [(1, 5), (2, 3), (4, 2), (6, 1)])
def test_episodes_share_an_execution(copies: int, programs: int) -> None:
    """Five clocks of three steps; up to 6 copies of 4 circuits fit fake_toronto's 25 qubits."""
    policy = stubborn("Clock-v0", 2, 3)
    policy = replace(policy, program=parallel(4, 1)[0], weights=np.zeros((3, 4)), theta=np.zeros(4),
                     encoder=Encoder("arctan", np.array([0, 1, 0, 1]), np.ones(4)))  # fmt: skip
    deployment = deploy(policy, "fake_toronto", shots=100, copies=copies)
    result = play(deployment, 5)
    assert deployment.executable.round_count == 1
    assert result.env_steps == 15
    assert result.total_load.executions == 3 * programs * 100
    assert result.summary()["circuits_per_step"] == 4
    assert result.episodes == play(deploy(policy, "fake_toronto", shots=100), 5).episodes


def test_copies_play_the_same_episodes_where_nothing_is_random() -> None:
    alone, together = (play(deploy(cartpole(), greedy=True, copies=n), 3) for n in (1, 2))
    assert together.episodes == alone.episodes


def test_the_most_important_circuit_has_the_best_qubit() -> None:
    deployment = deploy(cartpole(), "fake_lima")
    best = deployment.policy.importance.argmax()
    assert deployment.executable.qubits[best] == load_device("fake_lima").usable[0]


def test_exact_shots_cost_nothing() -> None:
    summary = play(deploy(stubborn("Clock-v0", 2, 3)), 1).summary()
    assert (summary["shots"], summary["kind"]) == ("exact", "ideal")
    assert (summary["executions"], summary["qpu_seconds_estimate"]) == (0, None)


def test_rewards_of_a_known_environment() -> None:
    """Each of the copies of the clock is in its first episode: 11 + 12 + 13 and 3 half actions."""
    result = play(deploy(stubborn("Clock-v0", 2, 3, choice=2)), 3)
    assert result.episodes == [Episode(seed, 39.0, 3) for seed in range(3)]


@pytest.mark.parametrize(
    ("name", "choice", "episodes", "solved"),
    [
        ("ClockPaid-v0", 2, 99, None),  # too few episodes to say
        ("ClockPaid-v0", 2, 100, False),  # 39 of 40
        ("ClockPaid-v0", 0, 100, False),
        ("Clock-v0", 2, 100, None),  # no threshold
    ],
)
def test_solved_needs_a_threshold_and_a_hundred_episodes(
    name: str, choice: int, episodes: int, solved: bool | None
) -> None:
    summary = play(deploy(stubborn(name, 2, 3, choice)), episodes).summary()
    assert summary["solved"] is solved


def test_a_mean_at_the_threshold_is_solved() -> None:
    deployment = deploy(stubborn("ClockPaid-v0", 2, 3))
    for reward, solved in ((40.0, True), (39.99, False)):
        episodes = [Episode(seed, reward, 3) for seed in range(100)]
        assert RunResult(deployment, 40.0, episodes=episodes).summary()["solved"] is solved


def test_thresholds_are_those_of_gymnasium() -> None:
    known = {"CartPole-v1": 475, "CartPole": 475, "LunarLander-v3": 200, "Clock-v0": None}
    for name, threshold in known.items():
        assert reward_threshold(make_environments(name, 1)[0]) == threshold


def test_the_interval_of_equal_rewards_is_their_value() -> None:
    assert bootstrap_ci95(np.full(7, 42.0), 0) == [42.0, 42.0]
    assert bootstrap_ci95(np.zeros(0), 0) is None


@pytest.mark.parametrize("size", [5, 100])
def test_the_interval_is_scipy_s_percentile_bootstrap(size: int) -> None:
    """Two runs of 10000 resamples; an end at 2.5 % of a nearly normal law of deviation s has the
    error s sqrt(0.025 * 0.975 / 10000) / phi(1.96) = 0.027 s, their difference 0.038 s."""
    rewards = np.random.default_rng(0).normal(200, 30, size)
    found = bootstrap_ci95(rewards, 1)
    theirs = stats.bootstrap(
        (rewards,), np.mean, n_resamples=10_000, method="percentile", rng=np.random.default_rng(2)
    ).confidence_interval
    assert found is not None
    deviation = rewards.std() / np.sqrt(size)
    np.testing.assert_allclose(found, [theirs.low, theirs.high], atol=5 * 0.038 * deviation)
    assert found[0] < rewards.mean() < found[1]


def test_an_unknown_environment_gets_the_nearest_names() -> None:
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
        ("FrozenLake-v1", 1, 4, "FrozenLake-v1 observes Discrete"),
        ("CartPole-v1", 5, 2, "reads feature 4; observations of CartPole-v1 have 4 features"),
        ("CartPole-v1", 4, 3, "has 3 actions; CartPole-v1 has 2"),
        ("Acrobot-v1", 6, 2, "has 2 actions; Acrobot-v1 has 3"),
    ],
)
def test_an_environment_that_does_not_fit_is_refused(
    name: str, features: int, actions: int, message: str
) -> None:
    with pytest.raises(EnvironmentMismatchError, match=message):
        play(deploy(stubborn(name, features, actions)), 1)


def test_a_policy_may_read_fewer_features_than_there_are() -> None:
    assert len(play(deploy(stubborn("CartPole-v1", 2, 2)), 2).episodes) == 2


@pytest.mark.parametrize("episodes", [0, -1, MAX_EPISODES + 1])
def test_the_number_of_episodes_has_limits(episodes: int) -> None:
    with pytest.raises(CountsError, match=f"{episodes} episodes cannot be played"):
        play(deploy(cartpole()), episodes)


def test_settings_of_a_deployment_are_checked() -> None:
    with pytest.raises(CountsError, match="0 shots cannot be run"):
        deploy(cartpole(), shots=0)
    with pytest.raises(
        CalibrationError, match=r"Unknown mitigation 'magic'\.\n  Known: none, readout"
    ):
        deploy(cartpole(), mitigation="magic")


def test_the_first_episode_is_filmed() -> None:
    """A frame for every step of the first episode, which ends soon."""
    pytest.importorskip("pygame")
    frames: list[np.ndarray] = []
    rates: set[float] = set()

    def take(frame: np.ndarray, frames_per_second: float) -> None:
        frames.append(frame)
        rates.add(frames_per_second)

    result = play(deploy(stubborn("CartPole-v1", 4, 2)), 2, on_frame=take)
    assert len(frames) == result.episodes[0].length
    assert all(frame.shape[2] == 3 and frame.dtype == np.uint8 for frame in frames)
    assert rates == {50.0}  # CartPole's render_fps


def test_exact_shots_are_calibrated_exactly() -> None:
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


@pytest.mark.parametrize(
    ("shots", "circuits", "jobs"),
    [
        # Clock-v0 ends after 3 steps; 5 episodes live through all of them, on 5 qubits.
        (8192, 2, [1, 1, 1]),
        (2_000_000, 2, [1, 1, 1]),  # 5 x 2 M = 10 M: just one job
        (2_000_001, 2, [2, 2, 2]),
        (10_000_000, 2, [5, 5, 5]),
        (10_000_000, 6, [10, 10, 10]),  # two rounds
    ],
)
def test_a_step_is_as_many_jobs_as_ten_million_executions_need(
    shots: int, circuits: int, jobs: list[int]
) -> None:
    policy = stubborn("Clock-v0", 2, 3)
    program, feature = parallel(2, circuits // 2)
    policy = replace(
        policy,
        program=program,
        encoder=Encoder("arctan", np.array(feature), np.ones(circuits)),
        theta=np.zeros(circuits),
        weights=np.zeros((3, circuits)),
    )
    result = play(deploy(policy, "ibm_lima", shots=shots), 5)
    rounds = -(-circuits // 5)
    assert (result.steps, result.env_steps, result.load.jobs) == (3, 15, sum(jobs))
    assert result.total_load.executions == 15 * rounds * shots
    seconds = 2 * sum(jobs) + 0.00035 * result.total_load.executions
    assert result.summary()["qpu_seconds_estimate"] == pytest.approx(seconds)


def test_jobs_follow_the_episodes_that_live_on() -> None:
    """Three whole rows of 3 M executions in a job of 10 M; episodes end one by one."""
    result = play(deploy(stubborn("CartPole-v1", 4, 2), "ibm_lima", shots=3_000_000), 8)
    lengths = [episode.length for episode in result.episodes]
    living = [sum(length > step for length in lengths) for step in range(max(lengths))]
    assert living[0] == 8
    assert living[-1] < 8
    assert result.load.jobs == sum(math.ceil(alive / 3) for alive in living)
    assert result.steps == max(lengths)


@pytest.mark.parametrize("block", [1, 700, 12_345, 10**9])
def test_the_bootstrap_in_blocks_is_the_bootstrap(
    monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    """numpy draws the same numbers in any blocks: the interval stays to the last bit but rounding.

    The unblocked law is written out here: 2000 resamples of 37 rewards in one array.
    """
    rewards = np.random.default_rng(3).normal(200, 30, 37)
    drawn = np.random.default_rng(9).choice(rewards, (2000, 37)).mean(axis=1)
    monkeypatch.setattr("qcompile.rl.evaluate._BLOCK", block)
    found = bootstrap_ci95(rewards, 9, resamples=2000)
    np.testing.assert_allclose(found, np.percentile(drawn, [2.5, 97.5]), rtol=1e-12)


def test_the_bootstrap_of_many_rewards_needs_little_memory() -> None:
    """10,000 rewards, 10,000 times, are 800 MB at once; a block of a million numbers is 8 MB."""
    rewards = np.random.default_rng(4).normal(size=10_000)
    tracemalloc.start()
    found = bootstrap_ci95(rewards, 0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40e6
    assert found is not None
    # The law is normal by now: mean +- 1.96 s / 100, its ends known within 0.027 s / 100.
    deviation = rewards.std() / 100
    normal = rewards.mean() + deviation * stats.norm.ppf([0.025, 0.975])
    np.testing.assert_allclose(found, normal, atol=5 * 0.027 * deviation)


def test_an_environment_that_names_a_module_imports_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "trojan_horse.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(EnvironmentMismatchError, match="names a module to import"):
        play(deploy(stubborn("trojan_horse:CartPole-v1", 4, 2)), 1)
    assert "trojan_horse" not in sys.modules
    with pytest.raises(SystemExit, match="imported"):
        gymnasium.make("trojan_horse:CartPole-v1")
