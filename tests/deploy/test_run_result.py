"""The result of a run: jobs, executions, scores and their intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qcompile.deploy.environments import make_environments, reward_threshold
from qcompile.deploy.play import Episode, play
from qcompile.deploy.result import Run
from qcompile.policy import Encoder
from qcompile.policy.layouts import parallel

Make = Callable[..., Any]


def test_an_interrupted_step_is_counted_like_its_job(stubborn: Make, deploy: Make) -> None:
    """The job of the last step was run: its executions are those of every step."""

    def stop(episode: Episode) -> None:
        raise KeyboardInterrupt

    result = play(deploy(stubborn("Clock-v0", 2, 3), shots=100), 2, on_episode=stop)
    assert (result.load.jobs, result.decisions, result.total_load.executions) == (3, 6, 600)
    assert result.env_steps == 5  # the last one was measured and not taken


def test_an_interrupted_run_without_episodes_has_no_mean(cartpole: Make, deploy: Make) -> None:
    summary = Run(deploy(cartpole()), 5, interrupted=True).summary()
    for key in ("mean_reward", "std_reward", "ci95", "solved"):
        assert summary[key] is None
    assert summary["episodes"] == []


DOCUMENTED = """policy environment backend kind shots mitigation level seed episodes mean_reward
std_reward ci95 solved gates_per_circuit circuits_per_step rounds_per_step executions
qpu_seconds_estimate env_steps wall_seconds""".split()  # noqa: SIM905


def test_a_summary_has_what_is_documented_and_counts_by_hand(cartpole: Make, deploy: Make) -> None:
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
def test_episodes_share_an_execution(
    copies: int, programs: int, stubborn: Make, deploy: Make
) -> None:
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


def test_exact_shots_cost_nothing(stubborn: Make, deploy: Make) -> None:
    summary = play(deploy(stubborn("Clock-v0", 2, 3)), 1).summary()
    assert (summary["shots"], summary["kind"]) == ("exact", "ideal")
    assert (summary["executions"], summary["qpu_seconds_estimate"]) == (0, None)


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
    name: str, choice: int, episodes: int, solved: bool | None, stubborn: Make, deploy: Make
) -> None:
    summary = play(deploy(stubborn(name, 2, 3, choice)), episodes).summary()
    assert summary["solved"] is solved


def test_a_mean_at_the_threshold_is_solved(stubborn: Make, deploy: Make) -> None:
    deployment = deploy(stubborn("ClockPaid-v0", 2, 3))
    for reward, solved in ((40.0, True), (39.99, False)):
        episodes = [Episode(seed, reward, 3) for seed in range(100)]
        assert Run(deployment, 40.0, episodes=episodes).summary()["solved"] is solved
        cut = Run(deploy(deployment.policy, max_steps=30), 40.0, episodes=episodes)
        assert cut.summary()["solved"] is None


def test_thresholds_are_those_of_gymnasium() -> None:
    known = {"CartPole-v1": 475, "CartPole": 475, "LunarLander-v3": 200, "Clock-v0": None}
    for name, threshold in known.items():
        assert reward_threshold(make_environments(name, 1)[0]) == threshold


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
    shots: int, circuits: int, jobs: list[int], stubborn: Make, deploy: Make
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


def test_jobs_follow_the_episodes_that_live_on(stubborn: Make, deploy: Make) -> None:
    """Three whole rows of 3 M executions in a job of 10 M; episodes end one by one."""
    result = play(deploy(stubborn("CartPole-v1", 4, 2), "ibm_lima", shots=3_000_000), 8)
    lengths = [episode.length for episode in result.episodes]
    living = [sum(length > step for length in lengths) for step in range(max(lengths))]
    assert living[0] == 8
    assert living[-1] < 8
    assert result.load.jobs == sum(math.ceil(alive / 3) for alive in living)
    assert result.steps == max(lengths)
