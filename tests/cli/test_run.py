"""`qcompile run`: what it answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from qcompile.report.summary import print_run

Call = Callable[..., Any]
Capture = pytest.CaptureFixture[str]


def test_a_run_is_reported_in_words(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 5, "--backend", "ibm_lima")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("tiny in CartPole-v1 on ibm_lima (noise model)\n")
    assert "over 5 episodes (95 % interval" in answer.out
    few = qcompile("run", policy(), "--episodes", 1)
    assert "over 1 episode" in few.out
    assert "interval" not in few.out


@pytest.mark.parametrize(
    ("rewards", "words"), [([0.93, 0.97], "0.93 to 0.97"), ([-8.5, 12.0], "-8.5 to 12.0")]
)
def test_the_range_of_rewards_has_the_decimals_of_their_mean(
    qcompile: Call, policy: Call, capsys: Capture, rewards: list[float], words: str
) -> None:
    found = qcompile("run", policy(), "--episodes", 2, "--json").json()
    episodes = [{**found["episodes"][0], "reward": reward} for reward in rewards]
    print_run({**found, "episodes": episodes})
    assert f"rewards      ▁█  {words}" in capsys.readouterr().out


def test_the_json_document_holds_the_contract(
    qcompile: Call, policy: Call, run_keys: set[str]
) -> None:
    answer = qcompile("run", policy(), "--episodes", 3, "--seed", 5, "--shots", 100, "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert set(found) == run_keys
    assert [episode["seed"] for episode in found["episodes"]] == [5, 6, 7]
    assert all(set(episode) == {"seed", "reward", "length"} for episode in found["episodes"])
    rewards = [episode["reward"] for episode in found["episodes"]]
    assert rewards == [episode["length"] for episode in found["episodes"]]  # CartPole pays 1 a step
    assert found["mean_reward"] == pytest.approx(np.mean(rewards))
    assert found["std_reward"] == pytest.approx(np.std(rewards))
    assert found["ci95"][0] < found["mean_reward"] < found["ci95"][1]
    assert set(found["gates_per_circuit"]) == {"sx", "rz", "x", "rx"}
    expected = {
        "policy": "tiny",
        "environment": "CartPole-v1",
        "backend": "ideal",
        "kind": "ideal",
        "shots": 100,
        "mitigation": "none",
        "level": 2,
        "seed": 5,
        "greedy": False,
        "solved": None,
        "interrupted": False,
        "predistort": False,
        "calibration": None,
        "copies": 1,
        "couplings_per_circuit": 0,
        "circuits_per_step": 4,
        "observables_per_step": 4,
        "rounds_per_step": 1,
        "env_steps": sum(rewards),
        "executions": sum(rewards) * 100,
    }
    assert {key: found[key] for key in expected} == expected


def test_a_run_repeats_exactly(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(), "--episodes", 3, "--backend", "fake_lima", "--shots", 64, "--json")
    documents = [qcompile(*words, "--seed", seed).json() for seed in (7, 7, 8)]
    for document in documents:
        del document["wall_seconds"]
    assert documents[0] == documents[1]
    assert documents[0]["episodes"] != documents[2]["episodes"]


def test_an_alias_names_the_device_and_its_cost_is_counted(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 2, "--backend", "ibmq_lima", "--json")
    found = answer.json()
    assert (found["backend"], found["kind"]) == ("ibm_lima", "noise-model")
    assert found["mitigation"] == "readout"
    # 4 circuits fit side by side on 5 qubits; the calibration is one job of 6 x 8192;
    # every step of the longest episode is one job. IBM: 2 s for each job, 0.35 ms for each.
    assert found["rounds_per_step"] == 1
    assert found["executions"] == 8192 * found["env_steps"] + 6 * 8192
    jobs = 1 + max(episode["length"] for episode in found["episodes"])
    expected = 2 * jobs + 0.00035 * found["executions"]
    assert found["qpu_seconds_estimate"] == pytest.approx(expected)


def test_exact_expectations_cost_nothing(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(), "--episodes", 1, "--shots", "exact", "--greedy", "--json")
    found = qcompile(*words).json()
    assert (found["shots"], found["greedy"], found["executions"]) == ("exact", True, 0)
    assert found["qpu_seconds_estimate"] is None


def test_circuits_that_do_not_fit_take_rounds(qcompile: Call, policy: Call) -> None:
    wide = policy(
        circuits=[[["ry", "x0"]]] * 8, weights=[[1.0] * 8, [0.0] * 8], theta=[], bias=[0.0, 0.0]
    )
    words = ("run", wide, "--episodes", 1, "--backend", "ibm_lima", "--mitigation", "none")
    found = qcompile(*words, "--json").json()
    assert found["rounds_per_step"] == 2
    assert found["executions"] == 2 * 8192 * found["env_steps"]


def test_names_are_shown_as_they_are(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(name="[/red] [bold]"), "--episodes", 1)
    assert answer.code == 0
    assert answer.out.startswith("[/red] [bold] in CartPole-v1")
