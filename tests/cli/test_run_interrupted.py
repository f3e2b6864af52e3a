"""`qcompile run` after Ctrl-C: what is finished is reported, as no more than it is."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

Call = Callable[..., Any]


def test_an_interrupted_run_reports_what_is_finished(
    qcompile: Call, policy: Call, ctrl_c: Call
) -> None:
    ctrl_c(2)
    answer = qcompile("run", policy(), "--episodes", 50)
    assert answer.code == 1
    assert "over 2 episodes" in answer.out
    assert "interval" not in answer.out
    assert (
        answer.err
        == """\
Error: Interrupted: 2 of 50 episodes finished.
  These are the shortest ones: their mean does not estimate the policy's score.
  For a shorter run, use fewer --episodes.
"""
    )


def test_an_interrupted_run_is_still_one_json_document(
    qcompile: Call, policy: Call, ctrl_c: Call, run_keys: set[str]
) -> None:
    ctrl_c(3)
    answer = qcompile("run", policy(), "--episodes", 50, "--json")
    assert answer.code == 1
    found = answer.json()
    assert set(found) == run_keys
    assert found["ci95"] is None  # the shortest episodes end first: no estimate
    assert found["solved"] is None
    assert (found["interrupted"], len(found["episodes"])) == (True, 3)


INTERRUPTED_AT_ONCE = """
import os, signal
from qcompile.cli import main
from qcompile.deploy.deployment import Deployment

act = Deployment.act
def interrupted(self, observations, rows):
    os.kill(os.getpid(), signal.SIGINT)
    return act(self, observations, rows)
Deployment.act = interrupted
main()
"""


def test_a_process_interrupted_before_any_episode_is_finished(policy: Call) -> None:
    words = [sys.executable, "-W", "error", "-c", INTERRUPTED_AT_ONCE, "run", policy(), "--json"]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1
    found = json.loads(ended.stdout)
    assert found["interrupted"] is True
    assert found["episodes"] == []
    assert [found[key] for key in ("mean_reward", "std_reward", "ci95")] == [None] * 3
    assert "Interrupted: 0 of 20 episodes finished." in ended.stderr
    assert "Traceback" not in ended.stderr
