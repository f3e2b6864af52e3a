"""The cost and reward of live episodes, measured with a stand-in for IBM's service.

    python benchmarks/budget.py --only lander

The unmodified client of qiskit-ibm-runtime sends the jobs of `qcompile run --live` to the stand-in
in tests/standin, which charges IBM's published estimate, 2 s per job and 0.35 ms per execution, and
draws its own noise. The commands are those recommended by `qcompile plan --within`; all seconds
come from the stand-in's ledger, calibration included. Episodes reset with the seeds from --seed on.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from budget_service import LARGE, MACHINES, SMALL, Row, Service
from standin import StandIn

FREE_S = 600.0
HELD = {"lunarlander_hold": (265, 130), "cartpole_hold": (485, 100), "acrobot_hold": (-83, 30)}
"""The least mean reward and the most seconds of a hundred episodes of each task."""
TASKS = ("lunarlander", "cartpole", "acrobot")
_ANYTHING_S = 20_000.0
_TRAINED = Path(__file__).parent.parent / "trained"


def lander(service: Service, seed: int) -> Iterator[Row]:
    """A hundred LunarLander episodes of the shipped policy, without holding decisions."""
    row = service.planned("lander", "lunarlander", LARGE, 100, 300, seed)
    yield row.want_mean(268).want_seconds(300).want_planned()


def held(service: Service, seed: int) -> Iterator[Row]:
    """A hundred episodes of each policy that holds its decisions."""
    for policy, (mean, seconds) in HELD.items():
        if (_TRAINED / f"{policy}.json").exists():
            row = service.planned("held", policy, LARGE, 100, seconds, seed, "--keep", "0.99")
            yield row.want_mean(mean).want_seconds(seconds).want_planned()


def month(service: Service, seed: int) -> Iterator[Row]:
    """Twenty episodes of each task within the seconds of one month, without holding decisions."""
    service.stand_in.settings.usage_limit_seconds = (
        FREE_S + service.stand_in.ledger().charged_seconds
    )
    left_s = FREE_S
    for policy, share_s in zip(TASKS, (240, 260, 100), strict=True):
        row = service.planned("month", policy, LARGE, 20, share_s, seed)
        left_s -= row.qpu_seconds
        yield row.want(f"{left_s:.0f} of {FREE_S:g} s left", left_s >= 0)
    service.stand_in.settings.usage_limit_seconds = 1e9


def paper(service: Service, seed: int) -> Iterator[Row]:
    """Five episodes of each task as the paper played them, nothing held."""
    most_s = 65.0
    for policy, cut in (("cartpole_1q", ("--max-steps", "200")), ("acrobot", ())):
        words = ("--shots", "1024", *cut)
        row = service.planned("paper", policy, LARGE, 5, most_s, seed, *words)
        row.wrong = [words for words in row.wrong if not words.endswith("episodes are cut")]
        most_s -= row.qpu_seconds
        yield row.want(f"{65 - most_s:.0f} of 65 s", most_s >= 0)
    for shots in (6144, 4096):
        row = service.planned("paper", "lunarlander", LARGE, 5, 500, seed, "--shots", str(shots))
        row.want_seconds(500)
        if not row.wrong or shots == 4096:
            yield row.want(f"{shots} shots", shots >= 4096)
            return


def small(service: Service, seed: int) -> Iterator[Row]:
    """The same on 27 qubits, at any cost."""
    for policy in ("lunarlander", *HELD):
        if (_TRAINED / f"{policy}.json").exists():
            yield service.planned("small", policy, SMALL, 100, _ANYTHING_S, seed).want_planned()


def seeds(service: Service, seed: int) -> Iterator[Row]:
    """Commands of plans, played with other seeds: nine in ten must lie below the interval's end."""
    for policy in ("acrobot", "cartpole"):
        plan = service.plan(policy, LARGE, 20, FREE_S, seed)
        low, high = plan["qpu_seconds_80"]
        for other in range(seed + 10_000, seed + 60_000, 10_000):
            command = plan["command"].replace(f"--seed {seed}", f"--seed {other}")
            row = service.run("seeds", command)
            row.planned_seconds, row.planned_80 = plan["qpu_seconds"], (low, high)
            inside = low <= row.qpu_seconds <= high
            row.wanted = f"{'in' if inside else 'out'}side {low:.0f} to {high:.0f} s"
            yield row


def plans(service: Service, seed: int) -> Iterator[Row]:
    """A hundred episodes of each shipped policy within a month's seconds, or the cheapest."""
    for path in sorted(_TRAINED.glob("*.json")):
        row = service.planned("plans", path.stem, LARGE, 100, FREE_S, seed)
        yield row.want_planned()


PARTS: dict[str, Callable[[Service, int], Iterator[Row]]] = {
    part.__name__: part for part in (lander, held, month, paper, small, seeds, plans)
}


@click.command()
@click.option("--only", type=click.Choice(list(PARTS)), multiple=True, help="Run only these parts.")
@click.option("--seed", default=10_000, show_default=True, help="Episode i resets with seed + i.")
@click.option("--noise", default=1, show_default=True, help="Seed of the machines' noise.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=Path("budget.json"),
    show_default=True,
    help="JSON file of all rows; rows of parts that are not measured now are kept.",
)
def main(only: tuple[str, ...], seed: int, noise: int, out: Path) -> None:
    """Measure the cost and reward of live episodes, from the ledger of the stand-in."""
    console = Console(width=150)
    measured = [row for row in _read(out) if row["part"] not in (only or PARTS)]
    wrong = 0
    paths = (str(Path(__file__).parent.parent), os.environ.get("PYTHONPATH", ""))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    for name in only or PARTS:
        with (
            tempfile.TemporaryDirectory(prefix="budget-") as folder,
            StandIn(MACHINES, seed=noise, run_seconds=0.0, usage_limit_seconds=1e9) as stand_in,
        ):
            began = time.monotonic()
            rows = []
            for row in PARTS[name](Service(Path(folder), stand_in), seed):
                rows.append(row)
                console.print(f"{name}: {row.command}", *row.wrong, sep="\n  ", markup=False)
            console.print(table(name, rows, time.monotonic() - began))
            wrong += sum(len(row.wrong) for row in rows)
            measured += [row.values() for row in rows]
            out.write_text(json.dumps(measured, indent=1) + "\n")
    sys.exit(1 if wrong else 0)


def _read(path: Path) -> list[dict[str, object]]:
    return list(json.loads(path.read_text())) if path.exists() else []


def table(name: str, rows: list[Row], seconds: float) -> Table:
    """A table of a part's rows, beside the plan and the paper's strategy."""
    grid = Table(title=f"{name} ({PARTS[name].__doc__}) {seconds:.0f} s", title_justify="left")
    right = ("qubits", "episodes", "cut", "mean", "jobs", "executions")
    right += ("QPU s", "planned", "80 %", "the paper's way")
    grid.add_column("policy and options", max_width=52)
    for column in right:
        grid.add_column(column, justify="right")
    grid.add_column("wanted")
    for row in rows:
        words = row.command.removeprefix("qcompile run ").split()
        mean = "-" if row.mean_reward is None else f"{row.mean_reward:.1f}"
        grid.add_row(
            " ".join(words),
            *map(str, (row.qubits, row.episodes, row.cut_episodes, mean, row.jobs)),
            f"{row.executions:,}",
            f"{row.qpu_seconds:.1f}",
            "" if row.planned_seconds is None else f"{row.planned_seconds:.1f}",
            "" if row.planned_80 is None else "{:.0f} to {:.0f}".format(*row.planned_80),
            "" if row.paper_seconds is None else f"{row.paper_seconds:,.0f}",
            f"{row.wanted}{' (!)' * bool(row.wrong)}",
        )
    return grid


if __name__ == "__main__":
    main()
