"""A held policy on a live backend, and the mean of its cut episodes completed."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from live_runs import LIMIT_S, Runs, check_paid_once, played

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.rows import Rows
from qcompile.policy import load_policy, save_policy

WORDS = ("run", "held.json", "--backend", "fake_lima", "--live", "--yes", "--json")
OPTIONS = ("--shots", 64, "--mitigation", "none", "--max-qpu-seconds", LIMIT_S)
OPTIONS += ("--episodes", 2, "--max-steps", 7)


def stepped(steps: list[dict[str, Any]], episode: int, hold: int) -> float:
    """The reward of CartPole from reset to end: recorded actions, then the noise model's."""
    policy = replace(load_policy("cartpole"), hold=hold)
    model = Deployment(policy, "fake_lima", shots=64, mitigation="none", seed=0)
    environment = gymnasium.make("CartPole-v1")
    seen, _ = environment.reset(seed=episode)
    total, over, decision = 0.0, False, 0
    while not over:
        if decision < len(steps):
            action = steps[decision]["actions"][episode]
        else:
            row = Rows(np.array([episode]), np.array([decision]))
            (action,) = model.act(seen[None].astype(float), row).tolist()
        for _ in range(hold):
            seen, paid, terminated, truncated, _ = environment.step(action)
            total, over = total + float(paid), terminated or truncated
            if over:
                break
        decision += 1
    environment.close()
    return total


def test_a_held_run_sends_a_job_for_each_decision(runs: Runs) -> None:
    """Seven steps held for three are three decisions; the last is cut after one step.

    Against the journal's actions by hand, with the ledger of the service, and after a resume.
    """
    save_policy(replace(load_policy("cartpole"), hold=3), "held.json")
    answer = runs.call(*WORDS, *OPTIONS, "--speculate", 1)
    assert answer.code == 0, answer.err
    found = answer.json()
    check_paid_once(runs.service, 3)
    assert [found[key] for key in ("hold", "decisions", "env_steps", "jobs")] == [3, 6, 14, 3]
    assert (found["cut_episodes"], found["mean_reward"]) == (2, 7.0)
    steps = json.loads(runs.call("runs", "export", "last").out)["steps"]
    assert [step["rewards"] for step in steps] == [[3.0, 3.0], [3.0, 3.0], [1.0, 1.0]]
    rewards = [stepped(steps, episode, 3) for episode in range(2)]
    assert found["mean_reward_completed"] == np.mean(rewards) > 7
    assert runs.call("resume", "last", "--json").json() == found
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        db.execute("UPDATE run SET result = NULL")
    again = runs.call("resume", "last", "--yes", "--json")
    assert played(again.json()) == played(found)
    check_paid_once(runs.service, 3)
    shown = " ".join(runs.call("runs", "show", "last").out.split())
    assert "6 decisions, 14 environment steps" in shown
    assert "with all episodes played to the end on the noise model" in shown


def test_held_decisions_are_measured_ahead(runs: Runs) -> None:
    save_policy(replace(load_policy("cartpole"), hold=3), "held.json")
    answer = runs.call(*WORDS, *OPTIONS, "--speculate", 3)
    assert answer.code == 0, answer.err
    found = answer.json()
    check_paid_once(runs.service, found["jobs"])
    assert found["jobs"] < 3
    assert [found[key] for key in ("hold", "decisions", "env_steps")] == [3, 6, 14]
    assert found["measured_rows"] >= 6
    assert found["cut_episodes"] == 2
    assert found["mean_reward_completed"] > 7
