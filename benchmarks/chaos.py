"""Break live runs in every known way, and check their reports against the service's ledger.

    python benchmarks/chaos.py --kills 200 --faults 600

Small complete runs from the command line, with the unmodified client of qiskit-ibm-runtime, use the
stand-in for IBM's service in tests/standin. They are killed at random moments, restored from an
older copy, resumed by two processes at once, killed before and after each write to the journal, and
exposed to each trouble of tests/standin/troubles.py. Some measure ahead, hold or split, one has
circuits of several qubits, and one is a user's program on a GuardedSampler. After each process the
run's report is compared with the ledger: it may not report less than was charged, and the limit
must hold or a doubt be reported. In the end its result must equal that of an undisturbed run,
nothing may be lost, and once the service has recovered the books must agree exactly. No process may
show a traceback, a control character or a token, and no file may contain one.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from chaos_copies import COPIES, TWO_AT_ONCE
from chaos_trial import HELD, KILLED, LIMIT_S, PROGRAM, SCENARIOS, WIDE, Trial
from live_ledger import charged_s
from standin import TROUBLES, StandIn, Trouble
from wide_policies import PAIR

KILLS, WRITES = "killed", "killed at a write"
TRAINED = Path(__file__).parent.parent / "trained"
_SETTINGS = {"run_seconds": 0.02, "usage_limit_seconds": 1e9}
_OF_BATCH = "shape: batch"


@dataclass
class Tally:
    """All trials of one kind."""

    trials: int = 0
    processes: int = 0
    kills: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    stops: Counter[str] = field(default_factory=Counter)
    charged_s: float = 0.0
    most_short_s: float = 0.0
    wrong: Counter[str] = field(default_factory=Counter)

    def add(self, trial: Trial, faults: Counter[str]) -> None:
        self.trials += 1
        self.processes += trial.starts
        self.kills += trial.kills
        self.faults += faults
        self.stops += trial.stops
        self.charged_s += charged_s(trial.jobs)
        self.most_short_s = max(self.most_short_s, trial.most_short_s)
        self.wrong += Counter(set(trial.wrong))


@dataclass
class Chaos:
    """Trials of all kinds in one folder, compared with undisturbed runs."""

    folder: Path
    seed: int
    references: dict[str, dict[str, Any]] = field(default_factory=dict)
    live_s: dict[str, float] = field(default_factory=dict)

    def trial(self, scenario: str, stand_in: StandIn, **settings: Any) -> Trial:
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        for path in self.folder.glob("*.json"):
            shutil.copy(path, folder)
        return Trial(scenario, stand_in, folder, **settings)

    def prepare(self) -> None:
        """Calibrate a twin, write policies, and run each scenario undisturbed."""
        for name, shipped in HELD.items():
            policy = json.loads((TRAINED / f"{shipped}.json").read_text())
            policy |= {"format": "qcompile-policy-2", "hold": 2}
            (self.folder / name).write_text(json.dumps(policy))
        (self.folder / WIDE).write_text(json.dumps(PAIR))
        twin = ("calibrate", "--backend", "fake_lima", "--seed", "1", "--out", "twin.json")
        words = (sys.executable, "-m", "qcompile", *twin)
        subprocess.run(words, cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
        for scenario in SCENARIOS:
            with StandIn(**_SETTINGS) as stand_in:
                trial = self.trial(scenario, stand_in)
                running = trial.start()
                running.wait_for_run()
                started = time.monotonic()
                trial.check_process(running.wait())
                self.live_s[scenario] = time.monotonic() - started
                assert trial.result is not None, trial.folder
                self.references[scenario] = trial.result

    def kill(self, scenario: str, rng: np.random.Generator) -> tuple[Trial, Counter[str]]:
        """A run whose processes are killed at random moments."""
        with StandIn(**_SETTINGS) as stand_in:
            trial = self.trial(scenario, stand_in)
            trial.finish((rng, self.live_s[scenario]))
            trial.settle()
            trial.check(self.references[scenario], paid_once=True)
        return trial, Counter()

    def write(
        self, moment: int, scenario: str, rng: np.random.Generator
    ) -> tuple[Trial, Counter[str]]:
        """A run that is killed just before or after a write into its journal, and once more."""
        with StandIn(**_SETTINGS) as stand_in:
            trial = self.trial(scenario, stand_in)
            for kill_at in (moment, int(rng.integers(60))):
                ended = trial.start(kill_at=kill_at).wait()
                trial.kills += ended.code == KILLED
                trial.check_process(ended)
                if trial.result is not None:
                    break
            trial.finish()
            trial.settle()
            trial.check(self.references[scenario], paid_once=True)
        return trial, Counter()

    def trouble(
        self, trouble: Trouble, scenario: str, rng: np.random.Generator
    ) -> tuple[Trial, Counter[str]]:
        """A run in one kind of trouble, which ends after some resumed processes."""
        seed = int(rng.integers(2**31))
        with StandIn(**_SETTINGS) as stand_in:
            neighbours = _Neighbours(self, stand_in) if trouble.neighbours else None
            stand_in.faults.seed(seed)
            limit_s = trouble.limit_s or LIMIT_S
            trial = self.trial(scenario, stand_in, options=trouble.options, limit_s=limit_s)
            trouble.begin(stand_in)
            trial.finish()
            if trouble.finishes and trial.stops:
                trial.wrong.append("stops unnecessarily")
            trial.settle()
            trial.check(self.references[scenario], paid_once=trouble.paid_once)
            if neighbours is not None:
                trial.wrong += neighbours.wrong()
            faults = Counter(stand_in.ledger().faults)
        if faults["secrets_echoed"]:
            del faults["secrets_echoed"]  # it belongs to another trouble
        return trial, faults

    def copies(
        self, kind: str, scenario: str, rng: np.random.Generator
    ) -> tuple[Trial, Counter[str]]:
        """A run with two copies."""
        with StandIn(**_SETTINGS) as stand_in:
            trial = self.trial(scenario, stand_in)
            COPIES[kind](trial, rng, self.live_s[scenario])
            trial.settle()
            paid_once = kind != TWO_AT_ONCE
            trial.check(self.references[scenario], paid_once=paid_once)
            return trial, Counter(stand_in.ledger().faults) + Counter(copies=1)


class _Neighbours:
    """Two other runs of the account: one that waits in the queue, and one that has ended."""

    def __init__(self, chaos: Chaos, stand_in: StandIn):
        self._stand_in = stand_in
        words = ("run", "acrobot", "--backend", "fake_lima", "--episodes", "1", "--max-steps", "1")
        live = ("--live", "--yes", "--json", "--max-qpu-seconds", "60", "--mitigation", "none")
        for shots, queue_s in ((100, 0.0), (300, 3600.0)):
            stand_in.settings.queue_seconds = queue_s
            trial = chaos.trial("run", stand_in)
            trial.call(*words, *live, "--shots", str(shots), "--max-wait-seconds", "1")
        stand_in.recover()
        self._were = {job.id: job for job in stand_in.ledger().jobs}
        assert len(self._were) == 2

    def wrong(self) -> list[str]:
        """What happened to their jobs."""
        now = {job.id: job for job in self._stand_in.ledger().jobs}
        return [
            f"another run's job was touched: it was {was.status}"
            for id_, was in self._were.items()
            if now[id_] != was
        ]


def plan(chaos: Chaos, only: str, seed: int, writes: int) -> dict[str, Iterator[Callable[[], Any]]]:
    """For each kind its trials in sequence, each with its own generator."""
    ways: dict[str, Callable[..., Any]] = {KILLS: chaos.kill}
    for kind in COPIES:
        ways[kind] = lambda scenario, rng, kind=kind: chaos.copies(kind, scenario, rng)
    for moment in range(writes):
        ways[f"{WRITES} {moment}"] = lambda scenario, rng, moment=moment: chaos.write(
            moment, scenario, rng
        )
    for name, trouble in TROUBLES.items():
        ways[name] = lambda scenario, rng, trouble=trouble: chaos.trouble(trouble, scenario, rng)

    def trials(number: int, way: Callable[..., Any], names: list[str]) -> Iterator[Any]:
        seeds = np.random.SeedSequence([seed, number])
        for index, scenario in enumerate(cycle(names)):
            rng = np.random.default_rng([*seeds.generate_state(2), index])
            yield lambda scenario=scenario, rng=rng: way(scenario, rng)

    return {
        kind: trials(number, way, _scenarios(kind, number))
        for number, (kind, way) in enumerate(ways.items())
        if only in kind
    }


def _scenarios(kind: str, number: int) -> list[str]:
    """The scenarios of a kind, in turn; the next kind starts with the next scenario."""
    if kind.startswith(_OF_BATCH) and "batch" in SCENARIOS:
        return ["batch"]
    first = number % len(SCENARIOS)
    names = [*SCENARIOS][first:] + [*SCENARIOS][:first]
    if kind == TWO_AT_ONCE and PROGRAM in names:  # a copied program must first be resumed by name
        names.remove(PROGRAM)
    return names


@click.command()
@click.option("--kills", default=200, show_default=True)
@click.option("--writes", default=80, show_default=True, help="Moments at which to kill.")
@click.option("--faults", default=600, show_default=True, help="Each kind is tried at least once.")
@click.option("--seed", default=0, show_default=True)
@click.option("--only", default="", help="Only kinds whose name contains this.")
@click.option("--run", default="", help="Only runs whose name contains this, such as wide.")
@click.option("--workers", default=4, show_default=True, help="Trials at a time; they mostly wait.")
@click.option("--keep", is_flag=True, help="Keep the folders of the runs.")
def main(
    kills: int, writes: int, faults: int, seed: int, only: str, run: str, workers: int, keep: bool
) -> None:
    """Break live runs in every known way, and check their reports against the ledger."""
    for name in [name for name in SCENARIOS if run not in name]:
        del SCENARIOS[name]
    console = Console(width=118)
    folder = Path(tempfile.mkdtemp(prefix="chaos-"))
    paths = (sys.path[0], str(Path(__file__).parent), os.environ.get("PYTHONPATH", ""))
    os.environ |= {"HOME": str(folder), "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    chaos = Chaos(folder, seed)
    chaos.prepare()
    tallies: dict[str, Tally] = defaultdict(Tally)
    kinds = plan(chaos, only, seed, writes)
    of_kills = [kind for kind in kinds if kind == KILLS]
    at_writes = [kind for kind in kinds if kind.startswith(WRITES)]
    others = [kind for kind in kinds if kind not in (*of_kills, *at_writes)]
    started = time.monotonic()
    with ThreadPoolExecutor(workers) as pool:

        def carry_out(names: list[str]) -> None:
            def one(kind: str) -> tuple[str, Trial, Counter[str]]:
                return (kind, *next(kinds[kind])())

            for kind, trial, struck in pool.map(one, names):
                tallies[WRITES if kind in at_writes else kind].add(trial, struck)
                for words in dict.fromkeys(trial.wrong):
                    console.print(f"{kind}, {trial.scenario}, {trial.folder}: {words}")
                if not keep and not trial.wrong:
                    shutil.rmtree(trial.folder)

        while of_kills and tallies[KILLS].kills < kills:
            carry_out(of_kills * workers)
        for _ in SCENARIOS if at_writes else ():
            carry_out(at_writes)
        carry_out(others)
        while others and sum(tallies[kind].faults.total() for kind in others) < faults:
            carry_out(others)
    report(console, tallies, time.monotonic() - started)
    wrong = sum(tally.wrong.total() for tally in tallies.values())
    if not keep and not wrong:
        shutil.rmtree(folder)
    sys.exit(1 if wrong else 0)


def report(console: Console, tallies: dict[str, Tally], seconds: float) -> None:
    """Print a row for each kind, and the sums."""
    table = Table(
        "kind", "runs", "processes", "kills", "faults", "stops", "charged", "short", "wrong"
    )
    for kind, tally in tallies.items():
        table.add_row(
            kind,
            *map(str, (tally.trials, tally.processes, tally.kills, tally.faults.total())),
            str(tally.stops.total()),
            f"{tally.charged_s:.1f} s",
            f"{tally.most_short_s:.2f} s" if tally.most_short_s > 1e-6 else "",
            str(tally.wrong.total() or ""),
        )
    console.print(table)
    stops: Counter[str] = sum((tally.stops for tally in tallies.values()), Counter())
    console.print("explained stops, each resumed:")
    for words, count in stops.most_common(12):
        console.print(f"  {count} x {words}", markup=False)
    kills, faults = (
        sum(tally.kills for tally in tallies.values()),
        sum(tally.faults.total() for tally in tallies.values()),
    )
    runs = sum(tally.trials for tally in tallies.values())
    wrong: Counter[str] = sum((tally.wrong for tally in tallies.values()), Counter())
    console.print(f"{kills} kills and {faults} faults in {runs} runs, {seconds:.0f} s.")
    console.print(f"wrong: {dict(wrong) or 'nothing'}", markup=False)


if __name__ == "__main__":
    main()
