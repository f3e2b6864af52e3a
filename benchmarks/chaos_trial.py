"""One live run of the command line under chaos: its processes and their traces."""

from __future__ import annotations

import json
import math
import multiprocessing
import shutil
import sqlite3
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
from live_ledger import (
    charged_of_steps,
    charged_s,
    jobs_of,
    secrets_in,
    settled_wrong,
    told_wrong,
    words_wrong,
)
from standin import Entry, StandIn

PLAY = ("run", "cartpole", "--backend", "fake_lima", "--episodes", "2", "--max-steps", "6")
LIVE = ("--live", "--yes", "--json")
PROGRAM, KILL_AT = "program", "CHAOS_KILL_AT"
"""The module chaos_command, loaded only in the processes of runs."""
HELD = {"one.json": "cartpole_1q", "four.json": "cartpole"}
"""Policies that hold each decision for two steps, and the shipped policies they come from."""
WIDE = "pair.json"
"""A policy with a circuit of two qubits."""
SCENARIOS = {
    "run": (*PLAY, "--shots", "256", "--mitigation", "none", *LIVE),
    "batch": (*PLAY, "--shots", "256", "--mitigation", "response", "--batch", *LIVE),
    "calibrate": (
        *("calibrate", "--backend", "fake_lima", "--parts", "readout,response"),
        *("--shots", "1024", "--out", "made.json", "--force", *LIVE),
    ),
    "validate": ("validate", "twin.json", "--policy", "acrobot", "--shots", "512", *LIVE),
    "ahead": (*PLAY, "--shots", "64", "--mitigation", "none", "--speculate", "3", *LIVE),
    "held": (
        *("run", "four.json", "--backend", "fake_lima", "--episodes", "2", "--max-steps", "10"),
        *("--shots", "64", "--speculate", "auto", "--calibration-shots", "300", *LIVE),
    ),
    "split": (
        *("run", "one.json", "--backend", "fake_lima", "--episodes", "3", "--max-steps", "12"),
        *("--shots", "50", "--split", "--copies", "4", "--speculate", "2", *LIVE),
    ),
    "wide": (
        *("run", WIDE, "--backend", "fake_toronto", "--episodes", "3", "--max-steps", "6"),
        *("--shots", "64", "--copies", "2", "--speculate", "2", "--calibration-shots", "300"),
        *LIVE,
    ),
    PROGRAM: (PROGRAM,),
}
LIMIT_S, MORE_S = 100.0, 1000.0
OF_RUN = {
    *("run", "wall_seconds", "created", "device", "file", "max_qpu_seconds"),
    *("qpu_seconds", "qpu_seconds_settled", "jobs_in_doubt", "jobs_uncharged"),
}
"""The keys that may differ between equal results; charges are checked separately."""
_ENVIRONMENT = {
    "QCOMPILE_SETTLE_SECONDS": "0.4",
    "QCOMPILE_PATIENCE_SECONDS": "2",
    "USAGE_DATA_OPT_OUT": "True",
}
_SETTLED = {"QCOMPILE_DOUBT_SECONDS": "0"}
_TRIES_IN_TROUBLE, _MAX_TRIES = 4, 30
_LONGEST_S = 60.0
HUNG = 99
"""The exit code of a process that had to be killed after _LONGEST_S."""
KILLED = -9

_fork = multiprocessing.get_context("forkserver")
_fork.set_forkserver_preload(["chaos_command", "chaos_copies"])


@dataclass
class Ended:
    """An ended process: its exit code, negative if it was killed, and its streams."""

    code: int
    out: str
    err: str


@dataclass
class Trial:
    """A run with its own folder and service."""

    scenario: str
    stand_in: StandIn
    folder: Path
    limit_s: float = LIMIT_S
    options: tuple[str, ...] = ()
    runs: Path = Path("runs")
    result: dict[str, Any] | None = None
    kills: int = 0
    starts: int = 0
    stops: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    most_short_s: float = 0.0
    """The largest amount by which a report fell short of the charges."""
    doubted: bool = False
    alone: bool = True
    """Whether no copy runs elsewhere, whose jobs the run learns about only at the end."""

    @property
    def run(self) -> str | None:
        """The name of the run's folder, once it has begun."""
        begun = [path.parent.name for path in (self.folder / self.runs).glob("*/journal.sqlite")]
        return begun[0] if begun else None

    @property
    def jobs(self) -> list[Entry]:
        """The jobs that the service has of the run, by the id in its journal."""
        if self.run is None:
            return []
        path = self.folder / self.runs / self.run / "journal.sqlite"
        with closing(sqlite3.connect(path)) as db:
            [[id_]] = db.execute("SELECT id FROM run")
        return jobs_of(self.stand_in, id_)

    def words(self) -> tuple[str, ...]:
        """The command that starts or resumes the run; a program is run again."""
        if self.scenario == PROGRAM:
            return (PROGRAM, f"{self.limit_s:g}")
        if self.run is None:
            limit = ("--max-qpu-seconds", f"{self.limit_s:g}")
            return (*self.options, *SCENARIOS[self.scenario], *limit)
        more = ("--max-qpu-seconds", f"{self.limit_s:g}") if self.limit_s > LIMIT_S else ()
        options = ("--runs", str(self.runs), "--yes", "--json", *more)
        return (*self.options, "resume", self.run, *options)

    def start(self, *words: str, settled: bool = False, kill_at: int | None = None) -> Running:
        """A process of the command line or the program, in the folder of the trial."""
        self.starts += 1
        environment = _ENVIRONMENT | (_SETTLED if settled else {})
        environment |= {} if kill_at is None else {KILL_AT: str(kill_at)}
        environment |= self.stand_in.environment() | {"HOME": str(self.folder)}
        return Running(self.folder, self.starts, words or self.words(), environment)

    def call(self, *words: str, settled: bool = False) -> Ended:
        return self.start(*words, settled=settled).wait()

    def check_process(self, ended: Ended) -> None:
        """Store the result of an ended process, and record everything wrong with its output."""
        words = ended.err
        if self.options and "\nqcompile.errors." in words:
            words = ""  # a traceback was requested
        self.wrong += words_wrong(words)
        if ended.code in (0, 1) and ended.out.strip():
            self.result = json.loads(ended.out)
        elif ended.code == 1:
            error = words.partition("Error: ")[2]
            if not error and words:
                self.wrong.append(f"no explanation of the failure: {words[-300:]!r}")
            self.stops[" ".join(error.split("\n")[0].split()[:6])] += 1
        elif ended.code != KILLED:
            self.wrong.append(f"exit code {ended.code}: {words[-300:]!r}")
        self.look()

    def look(self) -> dict[str, Any] | None:
        """Compare the run's current report with the ledger just before it."""
        if self.run is None or not self.alone:
            return None
        charged = charged_s(self.jobs)
        shown = self.call("runs", "show", self.run, "--runs", str(self.runs), "--json")
        if shown.code or not shown.out:
            self.wrong.append(f"runs show: {shown.err[-300:]!r}")
            return None
        told: dict[str, Any] = json.loads(shown.out)
        self.most_short_s = max(self.most_short_s, charged - told["qpu_seconds"])
        self.doubted = self.doubted or told.get("jobs_in_doubt", 0) > 0
        limit_s = math.inf if self.doubted else self.limit_s
        self.wrong += told_wrong(told, charged, limit_s)
        return told

    def finish(self, moments: tuple[np.random.Generator, float] | None = None) -> None:
        """Start or resume the run until it has a result; first with trouble, then without.

        `moments` kills processes: a generator, and how long the live part of a run takes.
        """
        for attempt in range(_MAX_TRIES):
            if self.result is not None:
                return
            if attempt == _TRIES_IN_TROUBLE and moments is None:
                self.stand_in.recover()
            stopped = any(words.startswith("The limit of") for words in self.stops)
            if stopped and attempt > _TRIES_IN_TROUBLE:
                self.limit_s = MORE_S
            if self.scenario == PROGRAM and self.run is not None and attempt % 2:
                fetched = self.call("resume", self.run, "--runs", str(self.runs), "--yes")
                self.wrong += words_wrong(fetched.err)
                self.look()
            running = self.start()
            if moments is not None and self.kills < 4:
                rng, live_s = moments
                running.wait_for_run()
                time.sleep(rng.uniform(0, live_s))
                self.kills += running.kill()
            ended = running.wait()
            self.check_process(ended)
            if ended.code == HUNG:
                self.stand_in.recover()
        self.wrong.append("does not end")

    def settle(self) -> None:
        """Let the service recover, resume the finished run, and compare the books exactly."""
        self.stand_in.recover()
        run = self.run
        if run is None or self.result is None:
            return
        words = ("resume", run, "--runs", str(self.runs), "--yes", "--json")
        if self.scenario == PROGRAM:
            words = self.words()
        ended = self.call(*words, settled=True)
        if ended.code or not ended.out:
            self.wrong.append(f"no result after resuming: {ended.err[-300:]!r}")
            return
        told = json.loads(ended.out)
        charged = charged_s(self.jobs)
        self.wrong += settled_wrong(told, charged)
        if plain(told) != plain(self.result):
            self.wrong.append("a different result after resuming")

    def check(self, reference: Mapping[str, Any], *, paid_once: bool) -> None:
        """Compare the result with the undisturbed run's, and every step with its charge."""
        if self.result is not None and plain(self.result) != plain(reference):
            self.wrong.append("another result")
        if self.run is not None:
            charged = charged_of_steps(self.jobs)
            if any(not seconds for seconds in charged.values()):
                self.wrong.append("a step without a charge")
            if paid_once and any(len(seconds) > 1 for seconds in charged.values()):
                self.wrong.append("a step that was charged twice")
        self.wrong += secrets_in(self.folder, self.stand_in)


@dataclass
class Running:
    """A process of the command line, forked from one that has imported everything."""

    folder: Path
    number: int
    words: tuple[str, ...]
    environment: Mapping[str, str]

    def __post_init__(self) -> None:
        import chaos_command

        self._process: BaseProcess = _fork.Process(  # type: ignore[assignment]
            target=chaos_command.call,
            args=(self.words, str(self.folder), dict(self.environment), self.number),
        )
        self._process.start()

    def wait_for_run(self) -> None:
        """Wait until the run prints its id, or ends."""
        path = self.folder / f"err{self.number}"
        while self._process.is_alive():
            if path.exists() and "\nrun " in f"\n{path.read_text()}":
                return
            time.sleep(0.005)

    def kill(self) -> bool:
        """Kill the process; return whether it was alive."""
        alive = self._process.is_alive()
        self._process.kill()
        return alive

    def wait(self) -> Ended:
        self._process.join(_LONGEST_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
            (self.folder / f"err{self.number}").open("a").write(f"Hung for {_LONGEST_S:g} s.\n")
        files = [self.folder / f"{name}{self.number}" for name in ("out", "err", "code")]
        out, err, code = (path.read_text() if path.exists() else "" for path in files)
        return Ended(HUNG if "Hung for" in err else int(code or KILLED), out, err)


def plain(value: Any) -> Any:
    """A run's result, without the keys that may differ between equal results."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items() if key not in OF_RUN}
    return [plain(item) for item in value] if isinstance(value, list) else value


def copied(trial: Trial, name: str) -> Path:
    """A copy of the run's current folder, in another folder of runs with that name."""
    path = trial.folder / name
    assert trial.run is not None
    shutil.copytree(trial.folder / trial.runs / trial.run, path / trial.run)
    return Path(name)
