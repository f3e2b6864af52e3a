"""A policy whose decisions are held, in every command that plays or shows it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import pytest

Call = Callable[..., Any]

HELD: dict[str, Any] = {"format": "qcompile-policy-2", "hold": 4}


def decisions_of(found: dict[str, Any]) -> int:
    return sum(-(-episode["length"] // 4) for episode in found["episodes"])


def test_a_run(qcompile: Call, policy: Call, run_keys: set[str]) -> None:
    words = ("run", policy(**HELD), "--backend", "ibm_lima", "--episodes", 3, "--shots", 16)
    found = qcompile(*words, "--mitigation", "none", "--json").json()
    assert set(found) == run_keys
    lengths = [episode["length"] for episode in found["episodes"]]
    assert found["hold"] == 4
    assert found["env_steps"] == sum(lengths) == sum(e["reward"] for e in found["episodes"])
    assert found["decisions"] == decisions_of(found) < found["env_steps"]
    assert found["executions"] == 16 * found["decisions"]
    assert found["jobs"] == max(-(-length // 4) for length in lengths)
    assert found["qpu_seconds_estimate"] == pytest.approx(
        2 * found["jobs"] + 0.00035 * found["executions"]
    )
    said = " ".join(qcompile(*words, "--mitigation", "none").out.split())
    assert f"{found['decisions']} decisions, {found['env_steps']} environment steps in " in said
    assert "1 round; held for 4 environment steps" in said
    plain = qcompile(*("run", policy(), *words[2:])).out
    assert "environment step" not in plain
    assert "decision" not in plain


def test_a_cut_run_is_told_with_its_completed_mean(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(**HELD), "--episodes", 5, "--shots", 16)
    whole, cut = (qcompile(*words, *more, "--json").json() for more in ((), ("--max-steps", 9)))
    assert cut["mean_reward_completed"] == whole["mean_reward"] > cut["mean_reward"]
    assert cut["ci95_completed"] == whole["ci95"]
    assert cut["cut_episodes"] == sum(e["length"] > 9 for e in whole["episodes"]) > 0
    said = qcompile(*words, "--max-steps", 9).out
    mean = f"{whole['mean_reward']:.1f}"
    assert "after 9 steps; rewards count the part played" in said
    assert f"uncut          mean reward {mean} (95 % interval" in said


def test_every_frame_is_in_the_film(qcompile: Call, policy: Call) -> None:
    """An mp4 has each frame: as many as the first episode has environment steps, at their rate."""
    words = ("run", policy(**HELD), "--episodes", 1, "--json", "--video", "a.mp4")
    found = qcompile(*words).json()
    frames, seconds = imageio_ffmpeg.count_frames_and_secs("a.mp4")
    assert frames == found["env_steps"] > found["decisions"]
    assert frames / seconds == pytest.approx(50, rel=1e-3)


def test_a_grid(qcompile: Call, policy: Call) -> None:
    name = policy(**HELD)
    words = ("evaluate", name, "--backend", "ibm_lima", "--shots", 16, "--mitigation", "none")
    answer = qcompile(*words, "--episodes", 3, "--workers", 1, "--out", "e")
    assert "each decision held for 4 environment steps" in " ".join(answer.out.split())
    for found in json.loads(Path("e/results.json").read_text())["results"]:
        assert (found["hold"], found["decisions"]) == (4, decisions_of(found))
    run = qcompile("run", name, *words[2:], "--episodes", 3, "--json").json()
    assert found["episodes"] == run["episodes"]
    rows = list(csv.DictReader(Path("e/results.csv").read_text().splitlines()))
    assert [row["hold"] for row in rows] == ["4", "4"]
    assert rows[1]["decisions"] == str(run["decisions"])
    [cell] = Path("e/cells").glob("tiny-ibm_lima-*.json")
    values = json.loads(cell.read_text())
    values["summary"]["decisions"] += 1  # damaged: not that of its episodes
    cell.write_text(json.dumps(values))
    mended = qcompile(*words, "--episodes", 3, "--workers", 1, "--out", "e")
    assert "1 cell played, 1 loaded" in mended.out


def test_show_and_export(qcompile: Call, policy: Call) -> None:
    line = "each decision is held for 4 environment steps\n"
    plain, held = (qcompile("show", policy(**more)).out for more in ({}, HELD))
    assert held.replace(line, "") == plain
    assert line in held
    assert qcompile("show", policy(**HELD), "--json").json()["policy"]["hold"] == 4
    assert line in qcompile("show", policy(**HELD), "--surrogate").out
    assert qcompile("show", policy(**HELD), "--surrogate", "--json").json()["hold"] == 4
    assert qcompile("export", policy(**HELD), "--out", "job").out.endswith(line)
    assert json.loads(Path("job/job.json").read_text())["hold"] == 4
    assert "hold" not in qcompile("export", policy(), "--out", "other", "--json").json()


def test_a_network_is_shown_with_it(qcompile: Call) -> None:
    layers = [{"type": "dense", "weights": [[0.0] * 4] * 2, "bias": [0.0, 0.0]}]
    values = {"format": "qcompile-network-1", "name": "net", "environment": "CartPole-v1"}
    Path("net.json").write_text(json.dumps({**values, "layers": layers, "hold": 3}))
    assert "each decision is held for 3 environment steps\n" in qcompile("show", "net.json").out
    assert qcompile("show", "net.json", "--json").json()["policy"]["hold"] == 3
    found = qcompile("run", "net.json", "--episodes", 2, "--json").json()
    assert found["decisions"] == sum(-(-e["length"] // 3) for e in found["episodes"])


def test_a_plan_counts_decisions(qcompile: Call, policy: Call) -> None:
    """The paper's way is a job for each circuit and decision, of 8192 shots."""
    words = ("plan", policy(**HELD), "--backend", "ibm_toronto", "--mitigation", "none")
    planned = qcompile(*words, "--max-steps", 6, "--episodes", 2, "--json").json()
    assert [planned[key] for key in ("hold", "decisions", "env_steps")] == [4, 4, 12]
    loads = {way["name"]: (way["jobs"], way["executions"]) for way in planned["strategies"]}
    assert loads["as in the paper"] == (16, 16 * 8192)
    assert loads["packed"] == (4, 4 * 8192)
    assert loads["packed, lockstep"] == (2, 2 * 8192)
    said = " ".join(qcompile(*words, "--max-steps", 6, "--episodes", 2).out.split())
    assert "4 decisions, each held for 4 environment steps" in said


def test_a_twin_plays_and_is_validated(qcompile: Call, policy: Call, calibration: str) -> None:
    """The observations of a check are those that the held policy decides by."""
    name = policy(**HELD)
    found = qcompile("run", name, "--backend", calibration, "--episodes", 2, "--json").json()
    assert (found["kind"], found["hold"]) == ("measured-response", 4)
    assert found["decisions"] == decisions_of(found)
    words = ("validate", calibration, "--observations", 10, "--shots", 512, "--seed", 3, "--json")
    held, plain = (
        qcompile(*words, "--policy", policy(**more)).json()["chi_square"] for more in (HELD, {})
    )
    assert held != plain
