"""Reward against QPU seconds, over shots, holds and devices: `python benchmarks/frontier.py`.

For each task, hold, device and number of shots, the cheapest way to measure 100 episodes (reset
seeds 10000 to 10099) as `qcompile plan --within` finds it, scored over 200 whole episodes on the
device's noise model. Writes docs/frontier.json, two pictures into docs/images, and the table into
docs/background/frontier.md. Policies of hold 1 are the shipped ones, the others those of
benchmarks/held.
"""

from __future__ import annotations

import argparse
import json
import re
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

from frontier_pictures import draw_matrix, draw_seconds

import qcompile
from qcompile.deploy.settings import RunSettings
from qcompile.execution import Workload, load_backend
from qcompile.planning.point import undominated
from qcompile.planning.search import Evaluator, Goal, Ladder

ROOT = Path(__file__).parents[1]
HELD, DATA, PAGE = (
    ROOT / "benchmarks/held",
    ROOT / "docs/frontier.json",
    ROOT / "docs/background/frontier.md",
)
TASKS = ("lunarlander", "cartpole", "acrobot")
HOLDS = (1, 2, 4, 8)
NEVER_LEARNED = ("cartpole", 8)
"""A push held for eight steps lets the pole fall."""
DEVICES = ("fake_toronto", "fake_fez", "fake_lima")
SHOTS = (8, 16, 32, 64, 128, 256, 1024)
PAPER_SHOTS = 8192
EPISODES, SEED = 100, 10_000
_BETWEEN = re.compile(r"(<!-- frontier -->\n).*?(\n<!-- /frontier -->)", re.DOTALL)


def cell(task: str, hold: int, device: str) -> list[dict[str, Any]]:
    """The values of a policy on a device at each number of shots, the paper's strategy last.

    A job for each circuit of each decision, the decisions and the reward those at most shots.
    """
    policy = qcompile.load_policy(task if hold == 1 else HELD / f"{task}_{hold}.json")
    assert isinstance(policy, qcompile.Policy)
    assert policy.hold == hold
    backend = load_backend(device)
    settings = RunSettings(seed=SEED).resolved(backend.device)
    goal = Goal(settings, EPISODES, within=600)
    ladder = Ladder(policy, backend, goal, Evaluator([policy], goal), lambda done, words: None)
    place = {"task": task, "device": device}
    last = ladder.point(SHOTS[-1])
    points = [place | point.values for point in (*map(ladder.point, SHOTS[:-1]), last)]
    decisions = int(last.simulated.chains.decisions[:EPISODES].sum())
    paper = Workload.of_batch(1, 1, PAPER_SHOTS) * (decisions * len(policy.program))
    paper_values = {"hold": hold, "jobs": paper.jobs, "qpu_seconds": paper.qpu_seconds}
    return [*points, place | paper_values | {"mean_reward": last.mean_reward}]


def _of_place(place: tuple[str, int, str]) -> list[dict[str, Any]]:
    return cell(*place)


def joined(points: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The undominated plain values."""
    return undominated(points, lambda point: (point["qpu_seconds"], point["mean_reward"]))


def table(points: list[dict[str, Any]]) -> str:
    """The undominated points of each task and device, as Markdown."""
    lines = [
        "| task | device | hold | shots | copies | ahead | jobs | QPU seconds | 80 % | reward |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for task, device in product(TASKS, DEVICES):
        chosen = [p for p in points if (p["task"], p["device"]) == (task, device)]
        for p in joined(chosen):
            copies = f"{p['copies']}, split" if p["split"] else p["copies"]
            low, high = p["qpu_seconds_80"]
            cells = [task, device, p["hold"], p["shots"], copies, p["speculate"], p["jobs"]]
            cells += [f"{p['qpu_seconds']:,.0f}", f"{low:,.0f} to {high:,.0f}"]
            cells.append(f"{p['mean_reward']:.1f}")
            lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--draw", action="store_true", help="draw docs/frontier.json again")
    asked = parser.parse_args()
    if not asked.draw:
        places = [
            (task, hold, device)
            for device, task, hold in product(DEVICES, TASKS, HOLDS)
            if (task, hold) != NEVER_LEARNED
        ]
        all_values: list[dict[str, Any]] = []
        with ProcessPoolExecutor(asked.workers) as pool:
            for values in pool.map(_of_place, places):
                all_values += values
                DATA.write_text(json.dumps(all_values, indent=1) + "\n")
    values = json.loads(DATA.read_text())
    points = [value for value in values if "split" in value]
    paper = [value for value in values if "split" not in value and value["hold"] == 1]
    lines = {
        place: joined([p for p in points if (p["task"], p["device"]) == place])
        for place in product(TASKS, DEVICES)
    }
    images = ROOT / "docs/images"
    draw_matrix(points, TASKS, "fake_toronto", images / "matrix.png")
    draw_seconds(points, paper, lines, TASKS, DEVICES, images / "frontier.png")
    page = PAGE.read_text()
    PAGE.write_text(_BETWEEN.sub(lambda m: m[1] + table(points) + m[2], page))


if __name__ == "__main__":
    main()
