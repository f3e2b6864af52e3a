"""Kill live runs at random moments, break their service in every way, and compare what comes out.

    python benchmarks/chaos.py --kills 200 --faults 60

Small complete runs go from the command line, with the unmodified client of qiskit-ibm-runtime, to
the stand-in of IBM's service in tests/standin. Each is gone on with until it is finished. Then its
result must be that of an undisturbed run, and in the ledger of the service every job of the run
must have been charged exactly once, within the limit.
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
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from standin import Fault, StandIn

LIMIT_S = 100
PLAY = ("run", "cartpole", "--backend", "fake_lima", "--episodes", "2", "--max-steps", "6")
LIVE = ("--live", "--yes", "--max-qpu-seconds", str(LIMIT_S), "--json")
SCENARIOS = {
    "run": (*PLAY, "--shots", "256", *LIVE),
    "run, batch": (*PLAY, "--shots", "256", "--mitigation", "response", "--batch", *LIVE),
    "calibrate": (
        *("calibrate", "--backend", "fake_lima", "--parts", "readout,response"),
        *("--out", "made.json", "--force", *LIVE),
    ),
    "validate": ("validate", "twin.json", "--policy", "acrobot", "--shots", "512", *LIVE),
}
TWIN = "qcompile calibrate --backend fake_lima --seed 1 --out twin.json"
OF_RUN = {"run", "wall_seconds", "created", "device", "file", "qpu_seconds", "jobs_uncharged"}
"""What differs between two runs that found the same; charges are checked by themselves."""
AT_RANDOM = {
    Fault.RATE_LIMITED: (0.02, None),
    Fault.SERVER_ERROR: (0.02, None),
    Fault.BAD_GATEWAY: (0.02, None),
    Fault.UNAVAILABLE: (0.02, None),
    Fault.GATEWAY_TIMEOUT: (0.02, None),
    Fault.DROPPED: (0.02, None),
    Fault.CUT_ANSWER: (0.02, None),
    Fault.ACCEPTED_504: (0.1, "POST /jobs"),
    Fault.ACCEPTED_DROPPED: (0.1, "POST /jobs"),
    Fault.JOB_FAILS: (0.05, None),
    Fault.JOB_CANCELLED: (0.05, None),
    Fault.JOB_WAITS: (0.05, None),
    Fault.RESULTS_TRUNCATED: (0.05, None),
    Fault.RESULTS_MISSHAPEN: (0.05, None),
    Fault.RESULTS_EMPTY: (0.05, None),
}
"""Probabilities for each request, or each job."""
MOST_TRIES = 40


@dataclass
class Trial:
    """One run until it was finished: how often it was started, killed, and ended explained."""

    scenario: str
    folder: Path
    starts: int = 0
    kills: int = 0
    stops: Counter[str] = field(default_factory=Counter)
    result: Any = None
    seconds: float = 0.0
    """From the first sign of the run to its end, when nothing disturbed it."""


@dataclass
class Chaos:
    """The service, and the generator of moments."""

    stand_in: StandIn
    rng: np.random.Generator
    folder: Path

    def complete(self, scenario: str, moments: tuple[float, float] | None = None) -> Trial:
        """Run a scenario to its end.

        With `moments`, the seconds of the whole and of its live part, each process is killed at a
        random one: of the whole in one of three, else of the live part.
        """
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        for twin in self.folder.glob("twin.json"):
            shutil.copy(twin, folder)
        trial = Trial(scenario, folder)
        while trial.result is None:
            if trial.starts > MOST_TRIES:
                raise RuntimeError(f"{scenario} does not end: {folder}")
            self._start(trial, moments if trial.kills < 4 else None)
        return trial

    def _start(self, trial: Trial, moments: tuple[float, float] | None) -> None:
        begun = [path.parent.name for path in (trial.folder / "runs").glob("*/journal.sqlite")]
        words = ("resume", begun[0], "--json") if begun else SCENARIOS[trial.scenario]
        trial.starts += 1
        with (trial.folder / f"err{trial.starts}").open("w+") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "qcompile", *words],
                cwd=trial.folder,
                env=os.environ | self.stand_in.environment() | {"HOME": str(trial.folder)},
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
            )
            live = None
            if moments is None:
                live = self._live(trial, process)
            else:
                whole_s, live_s = moments
                if self.rng.random() < 1 / 3:
                    time.sleep(self.rng.uniform(0, whole_s))
                else:
                    self._live(trial, process)
                    time.sleep(self.rng.uniform(0, live_s))
                if process.poll() is None:
                    process.kill()
                    trial.kills += 1
            out, _ = process.communicate()
        if process.returncode == 0 or (process.returncode == 1 and out.strip()):
            trial.result = json.loads(out)
            trial.seconds = time.monotonic() - (live or time.monotonic())
        elif process.returncode == 1:
            words = (trial.folder / f"err{trial.starts}").read_text()
            error = words.partition("Error: ")[2]
            if not error or "Traceback" in words:
                raise RuntimeError(f"{trial.scenario} ended without a word: {words}")
            trial.stops[" ".join(error.splitlines()[0].split()[:6])] += 1
        elif process.returncode != -9:
            raise RuntimeError(f"exit code {process.returncode} of {words}: {trial.folder}")

    def _live(self, trial: Trial, process: subprocess.Popen[str]) -> float:
        """Wait for the first sign of the run on standard error; the time it came."""
        errors = trial.folder / f"err{trial.starts}"
        while process.poll() is None and "\nrun " not in f"\n{errors.read_text()}":
            time.sleep(0.005)
        return time.monotonic()


def plain(value: Any) -> Any:
    """What a run found, without what differs between two that found the same."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items() if key not in OF_RUN}
    return [plain(item) for item in value] if isinstance(value, list) else value


def faults_of(trial: Trial, reference: Trial, stand_in: StandIn) -> list[str]:
    """What is wrong with a finished trial, by its result and the ledger of the service."""
    wrong = []
    if plain(trial.result) != plain(reference.result):
        wrong.append("another result")
    run = next((trial.folder / "runs").glob("*/journal.sqlite")).parent.name
    charged: dict[str, list[float]] = defaultdict(list)
    executions = 0
    for job in stand_in.ledger().jobs:
        tag = next((t for t in job.tags if t.startswith(f"qcompile-{run}-")), None)
        if tag is not None:
            charged[tag.removeprefix(f"qcompile-{run}-").partition("-")[0]].append(
                job.charged_seconds
            )
            executions += job.executions if job.charged_seconds else 0
    if any(sum(seconds > 0 for seconds in of_one) != 1 for of_one in charged.values()):
        wrong.append("a job that is not charged once")
    total = sum(map(sum, charged.values()))
    if total > LIMIT_S:
        wrong.append("more than the limit")
    if not trial.result["jobs_uncharged"] and abs(total - trial.result["qpu_seconds"]) > 1e-6:
        wrong.append("another charge than the journal's")
    if executions != trial.result.get("executions", executions):
        wrong.append("other executions than the run's")
    return wrong


@click.command()
@click.option("--kills", default=200, show_default=True)
@click.option("--faults", default=60, show_default=True, help="Runs with faults at random.")
@click.option("--seed", default=0, show_default=True)
@click.option("--keep", is_flag=True, help="Keep the folder of the runs.")
def main(kills: int, faults: int, seed: int, keep: bool) -> None:
    """Kill live runs, break their service, and compare what comes out."""
    os.environ |= {"QCOMPILE_SETTLE_SECONDS": "0.5", "QCOMPILE_PATIENCE_SECONDS": "5"}
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    console = Console()
    folder = Path(tempfile.mkdtemp(prefix="chaos-"))
    wrong: Counter[str] = Counter()
    stops: Counter[str] = Counter()
    with StandIn(run_seconds=0.02, usage_limit_seconds=1e9) as stand_in:
        chaos = Chaos(stand_in, np.random.default_rng(seed), folder)
        subprocess.run(
            (sys.executable, "-m", *TWIN.split()),
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        references, moments = {}, {}
        for scenario in SCENARIOS:
            started = time.monotonic()
            references[scenario] = chaos.complete(scenario)
            moments[scenario] = time.monotonic() - started, references[scenario].seconds
            whole_s, live_s = moments[scenario]
            charged_s = references[scenario].result["qpu_seconds"]
            console.print(
                f"{scenario}: {whole_s:.1f} s, {live_s:.1f} s of it live, {charged_s:.1f} QPU s"
            )
        killed = runs = 0
        names = list(SCENARIOS)
        for _ in track(range(10 * kills), "kills", console=console, transient=True):
            if killed >= kills:
                break
            scenario = names[runs % len(names)]
            trial = chaos.complete(scenario, moments[scenario])
            killed, runs = killed + trial.kills, runs + 1
            for word in faults_of(trial, references[scenario], stand_in):
                wrong[f"{word} after a kill ({scenario}, {trial.folder})"] += 1
        console.print(f"{killed} kills in {runs} runs; wrong: {dict(wrong) or 'nothing'}")

        struck = Counter(stand_in.ledger().faults)
        stand_in.faults.wait_seconds = 1.0
        stand_in.faults.listing_lag_seconds = 0.3
        stand_in.settings.usage_lag_seconds = 0.3
        for kind, (probability, on) in AT_RANDOM.items():
            stand_in.faults.chance(kind, probability, on=on)
        starts = 0
        for number in track(range(faults), "faults", console=console, transient=True):
            scenario = names[number % len(names)]
            if number % 3 == 0:
                stand_in.faults.expire_tokens()
            trial = chaos.complete(scenario)
            starts += trial.starts
            stops += trial.stops
            for word in faults_of(trial, references[scenario], stand_in):
                wrong[f"{word} after faults ({scenario}, {trial.folder})"] += 1
        struck = Counter(stand_in.ledger().faults) - struck
        console.print(f"{faults} runs with {struck.total()} faults in {starts} processes")
        for kind, count in sorted(struck.items()):
            console.print(f"  {kind}: {count}")
        console.print("explained stops, each gone on from:")
        for words, count in stops.most_common():
            console.print(f"  {count} x {words}")
    console.print(f"wrong: {dict(wrong) or 'nothing'}")
    if not keep and not wrong:
        shutil.rmtree(folder)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
