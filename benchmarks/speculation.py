"""Does measuring ahead keep the law of an episode? Exactly on noise models, else by samples.

    python benchmarks/speculation.py --episodes 1000 --shots 16

First every shipped policy, FrozenLake and Blackjack are played on noise models and a twin, decision
by decision and D at a time, in every way to measure: episodes, rewards and actions must be the same
bit for bit. Then lunarlander is played on an executor whose counts are fresh, drawn by a generator
that knows nothing of episodes and decisions: two samples, with other seeds, are compared by the
tests of Kolmogorov and Smirnov and of Mann and Whitney.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import stats

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from fresh import FreshExecutor
from traced import blackjack, frozen_lake, traced

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.deploy.result import Run
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor, TwinExecutor
from qcompile.mitigation import calibrate
from qcompile.policy import Policy, load_circuits
from qcompile.policy.files import policy_names

DEVICE, SPARE_SEED = "fake_toronto", 1_000_000
WAYS: dict[str, dict[str, Any]] = {
    "none": {"mitigation": "none"},
    "readout": {"mitigation": "readout"},
    "response": {"mitigation": "response"},
    "predistort": {"mitigation": "none", "predistort": True},
    "greedy": {"mitigation": "readout", "greedy": True},
    "twin": {"twin": True},
    "copies": {"mitigation": "readout", "copies": 2},
    "split": {"mitigation": "readout", "copies": 2, "split": True},
    "cut": {"mitigation": "readout", "max_steps": 30},
}


def policies() -> Iterator[tuple[str, Callable[..., Policy]]]:
    """The shipped policies, and policies for stochastic environments, by name."""
    for name in policy_names():
        yield name, lambda name=name, **changes: replace(load_circuits(name), **changes)
    yield "FrozenLake", frozen_lake
    yield "Blackjack", blackjack


def differences(episodes: int, most_steps: int) -> tuple[int, list[str]]:
    """The number of runs that measured ahead, and those that differed."""
    device = load_device(DEVICE)
    twin = calibrate(OfflineExecutor(device, 3), np.arange(len(device.qubits)), 2000)
    compared, different = 0, []
    for (name, make), (way, settings), hold in product(policies(), WAYS.items(), (1, 2, 4)):
        policy = make()
        if policy.hold != 1 and hold != 1:
            continue
        policy = policy if hold == 1 else replace(policy, hold=hold)
        given = {"shots": 16, "seed": 7, "max_steps": most_steps, **settings}
        backend: Any = TwinExecutor(twin) if given.pop("twin", False) else device

        def found(depth: Any, policy: Policy = policy, at: Any = backend, s: Any = given) -> Any:
            run, actions = traced(Deployment(policy, at, speculate=depth, **s), episodes)
            return run.episodes, actions, run.decisions, run.env_steps

        plain = found(1)
        for depth in (2, 16, "auto"):
            compared += 1
            if found(depth) != plain:
                different.append(f"{name}, {way}, hold {hold}, D {depth}")
    return compared, different


def sample(name: str, depth: Any, shots: int, episodes: int, seed: int) -> tuple[Run, float]:
    """A run on a machine with fresh counts, and the seconds it took here."""
    policy, machine = load_circuits(name), FreshExecutor(load_device(DEVICE), seed + 1)
    started = time.perf_counter()
    run = play(Deployment(policy, machine, shots=shots, speculate=depth, seed=seed), episodes)
    return run, time.perf_counter() - started


def p_values(first: Run, second: Run) -> list[float]:
    """The p-values for rewards and lengths: Kolmogorov-Smirnov and Mann-Whitney."""
    values = []
    for of in ("reward", "length"):
        both = [[getattr(episode, of) for episode in run.episodes] for run in (first, second)]
        values += [stats.ks_2samp(*both).pvalue, stats.mannwhitneyu(*both).pvalue]
    return values


@click.command(help=__doc__)
@click.option("--policy", default="lunarlander", show_default=True)
@click.option("--episodes", default=1000, show_default=True, help="Of each sample.")
@click.option("--shots", default=16, show_default=True)
@click.option("--depths", default="1,8,auto", show_default=True, help="The first is the reference.")
@click.option("--exact-episodes", default=3, show_default=True, help="0: no exact comparison.")
@click.option("--exact-steps", default=60, show_default=True, help="Steps of each episode.")
def main(
    policy: str, episodes: int, shots: int, depths: str, exact_episodes: int, exact_steps: int
) -> None:
    out = Console(width=120)
    wrong: list[str] = []
    if exact_episodes:
        compared, wrong = differences(exact_episodes, exact_steps)
        out.print(f"exact: {compared} runs that measured ahead, {len(wrong)} differ")
        for words in wrong:
            out.print(f"  {words}")
    table = Table(title=f"{policy}, {shots} shots, {episodes} episodes each, fresh counts")
    columns = ("D", "reward", "length", "jobs", "rows a decision", "s")
    for column in (*columns, "KS reward", "MW reward", "KS length", "MW length"):
        table.add_column(column, justify="right")
    reference: Run | None = None
    for number, word in enumerate(depths.split(",") if episodes else ()):
        depth = word if word == "auto" else int(word)
        run, seconds = sample(policy, depth, shots, episodes, number * SPARE_SEED)
        lengths = np.array([episode.length for episode in run.episodes])
        error = run.rewards.std() / np.sqrt(len(run.rewards))
        tested = ["-"] * 4
        if reference is not None:
            values = p_values(reference, run)
            tested = [f"{value:.3f}" for value in values]
            wrong += [f"D {depth}"] if min(values) < 1e-4 else []
        table.add_row(
            *(word, f"{run.rewards.mean():.1f} ± {error:.1f}", f"{lengths.mean():.1f}"),
            *(f"{run.load.jobs}", f"{run.measured_rows / run.decisions:.2f}", f"{seconds:.0f}"),
            *tested,
        )
        reference = reference or run
    if episodes:
        out.print(table)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
