"""Feed damaged files to every reader, and count what is refused in words, and what is not.

    python benchmarks/fuzz.py --inputs 1000000 --workers 2

Input i of a reader follows from --seed and i alone, so a run can be cut into parts with --first.
They are read in processes that may take 1 GB more than they start with; one that gets stuck or dies
is noted, and another goes on. Only a QcompileError counts as refused. Whatever is not refused in
words is kept in --keep, with the traceback.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from mutations import mutated, read_all
from rich.console import Console
from rich.progress import track
from rich.table import Table

import qcompile
from qcompile.device import IDEAL, Device, load_device
from qcompile.errors import QcompileError
from qcompile.evaluation import cell as evaluated
from qcompile.evaluation.grid import Cell
from qcompile.execution import DeviceBackend, load_backend
from qcompile.jobs.policy_job import read_observations
from qcompile.live.journal import FILE, Journal
from qcompile.live.perform import costs, task_of
from qcompile.live.play import RunTask
from qcompile.mitigation import calibrate
from qcompile.passes import compile
from qcompile.policy import Policy, load_policy, save_policy
from qcompile.policy.files import policy_values
from qcompile.qasm import read_file, write
from qcompile.report.live import exported
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings
from qcompile.study import cell as trained
from qcompile.study.rows import Cell as Training
from qcompile.study.rows import Claim, Row

ROOT = Path(qcompile.__file__).parent.parent
STUCK_S = 60
ROOM_BYTES = 2**30
CHUNK = 2000


@dataclass(frozen=True)
class Reader:
    """A reader: the kind of its files, their name, what reads one, and how many inputs it gets.

    `read` returns None where it refuses without words, as for a cell that is to be played again.
    """

    kind: str
    name: str
    read: Callable[[Path], object]
    seeds: Callable[[], list[bytes]]
    share: float


@cache
def policy() -> Policy:
    return load_policy(ROOT / "trained" / "cartpole.pt")


def saved(save: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        save(path)
        return path.read_bytes()


def policies(suffix: str) -> list[bytes]:
    found = [policy(), load_policy(ROOT / "trained" / "cartpole_1q.pt")]
    return [saved(partial(save_policy, one), f"p{suffix}") for one in found]


def use_policy(path: Path) -> object:
    """Read, compiled gate by gate, and written out."""
    loaded = load_policy(path)
    if sum(map(len, loaded.program.circuits)) < 200:
        write(compile(loaded.trained_program, IDEAL, 0, loaded.importance).native)
    return loaded


def checkpoints() -> list[bytes]:
    settings = Settings(episodes=4, reuse=2, pause_at=5.0, critic_hidden=(4,))
    found = []
    for changed in (settings, settings.changed(model="fcn", hidden=[4], reuse=1)):
        trainer = Trainer("CartPole-v1", changed, 1)
        trainer.train()
        found.append(saved(partial(save_checkpoint, trainer), "c.pt"))
    return found


def devices() -> list[bytes]:
    return read_all(ROOT / "hardware", "ibm_lima.json", "fake_lima.json", "ibm_belem.json")


def use_device(path: Path) -> object:
    device: Device = load_device(path)
    return device.usable


def calibrations() -> list[bytes]:
    device = load_device("ibm_lima")
    executor = DeviceBackend(device).open(1)
    made = calibrate(executor, np.array([0, 2]), 4096, parts=("readout", "response"))
    return [saved(made.save, "c.json")]


def observations(kind: str) -> list[bytes]:
    rows = np.random.default_rng(0).normal(size=(3, 4))
    if kind == "npy":
        arrays = (rows, np.asfortranarray(rows), rows[0].astype(">f4"))
        return [saved(partial(np.save, arr=array), "o.npy") for array in arrays]
    text = json.dumps(rows.tolist())
    return [(text if kind == "json" else text[2:-2].replace("], [", "\n")).encode()]


def use_observations(path: Path) -> object:
    return read_observations(path, policy())


QASM3 = b"""OPENQASM 3.0;
include "stdgates.inc";
input angle a;
const float b = 2 * pi / 3;
qubit[3] q;
bit[3] c;
gate twice(t) u { rx(t) u; rz(-t / 2) u; }
h q;
twice(a + b) q[0];
U(0.1, b, -a) q[1];
inv @ s q[2];
c = measure q;
"""
QASM2 = b"""OPENQASM 2.0;
include "qelib1.inc";
qreg q[3]; creg c[3];
gate mine(t) a { u3(t, 0, pi/2) a; u1(t^2) a; }
h q[0]; mine(0.3) q[1]; rz(sin(0.2)) q[2];
barrier q;
measure q -> c;
"""


@cache
def cell() -> Cell:
    tiny = replace(policy(), weights=0.1 * policy().weights)
    return Cell(tiny, DeviceBackend(load_device("ibm_lima")), 16, "none", 2, 3, 5)


def cells() -> list[bytes]:
    result = evaluated.run_cell(cell())
    assert isinstance(result, evaluated.CellResult)
    return [json.dumps(result.model_dump()).encode()]


@cache
def training() -> Training:
    settings = Settings(episodes=3)
    row = Row("cartpole", "SVQC", "cartpole", "CartPole-v1", "paper", settings, 1, 10.0, Claim("-"))
    return Training(row, 0)


def trainings() -> list[bytes]:
    return [json.dumps(trained.run_cell(training(), 2).model_dump()).encode()]


def journals() -> list[bytes]:
    values = {"backend": "ibm_lima", "device": load_device("ibm_lima"), "shots": 10, "episodes": 2}
    values |= {"policy": policy_values(policy()), "seed": 0, "level": 2, "mitigation": "none"}
    settings = RunTask.model_validate(values).model_dump(mode="json")
    with (
        tempfile.TemporaryDirectory() as folder,
        Journal.create(Path(folder), "run", "fuzz", settings, {"numpy": "2"}, 60.0) as made,
    ):
        for number in range(3):
            submission = made.note_sending(made.intend(number, "digest", 40), 5)
            made.note_sent(submission, f"job{number}")
            made.note_done(submission, np.ones((1, 4), dtype=int))
            charge = made.charges.of_job(f"job{number}")
            assert charge is not None
            made.charges.settle(charge, 2.5)
            made.note_actions(number, np.ones((2, 4)), np.ones(2, dtype=int))
            made.note_rewards(number, [1.0, 1.0])
        made._db.execute("PRAGMA journal_mode = DELETE")  # all in one file
        return [(made.folder / FILE).read_bytes()]


def use_journal(path: Path) -> object:
    """Listed, shown and exported, and its task read."""
    with Journal(path.parent) as journal:
        exported(journal)
        costs(journal)
        return task_of(journal)


READERS = {
    "policy .json": Reader("json", "p.json", use_policy, lambda: policies(".json"), 2),
    "policy .pt": Reader("pt", "p.pt", use_policy, lambda: policies(".pt"), 2),
    "checkpoint": Reader("pt", "c.pt", load_checkpoint, checkpoints, 1),
    "device": Reader("json", "d.json", use_device, devices, 2),
    "calibration": Reader("json", "c.json", lambda path: load_backend(str(path)), calibrations, 2),
    "observations .npy": Reader("npy", "o.npy", use_observations, lambda: observations("npy"), 2),
    "observations .json": Reader(
        "json", "o.json", use_observations, lambda: observations("json"), 2
    ),
    "observations .csv": Reader("text", "o.csv", use_observations, lambda: observations("csv"), 2),
    "OpenQASM 3": Reader("text", "p.qasm", read_file, lambda: [QASM3], 1),
    "OpenQASM 2": Reader("text", "p.qasm", read_file, lambda: [QASM2], 1),
    "cell of evaluate": Reader(
        "json", f"{cell().name}.json", lambda p: evaluated.read_cell(cell(), p.parent), cells, 1
    ),
    "cell of study": Reader(
        "json",
        f"{training().name}.json",
        lambda path: trained.read_cell(training(), path.parent),
        trainings,
        1,
    ),
    "journal": Reader("sqlite", FILE, use_journal, journals, 1),
}


@dataclass
class Tally:
    """What came of the inputs of a reader; `faults` has the traceback of one input of each kind."""

    inputs: int = 0
    refused: int = 0
    read: int = 0
    tracebacks: int = 0
    hangs: int = 0
    crashes: int = 0
    peak_mb: int = 0
    seconds: float = 0.0
    faults: Counter[str] = field(default_factory=Counter)

    def add(self, other: Tally) -> None:
        for name in ("inputs", "refused", "read", "tracebacks", "hangs", "crashes", "seconds"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.peak_mb = max(self.peak_mb, other.peak_mb)
        self.faults += other.faults


def try_one(reader: Reader, contents: bytes, path: Path, tally: Tally) -> str | None:
    """Read one input; the traceback where it is not refused in words."""
    path.write_bytes(contents)
    tally.inputs += 1
    try:
        found = reader.read(path)
    except QcompileError:
        tally.refused += 1
    except Exception as error:
        tally.tracebacks += 1
        words = traceback.format_exc()
        frame = traceback.extract_tb(error.__traceback__)[-1]
        tally.faults[f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}"] += 1
        return words
    else:
        tally.read += found is not None
        tally.refused += found is None
    return None


def inputs(name: str, seed: int, numbers: range) -> Iterator[tuple[int, bytes]]:
    reader, seeds = READERS[name], seeds_of(name)
    for number in numbers:
        yield number, mutated(reader.kind, f"{seed} {name} {number}", seeds)


@cache
def seeds_of(name: str) -> list[bytes]:
    found = READERS[name].seeds()
    with tempfile.TemporaryDirectory() as folder:  # what is damaged must be whole before
        for contents in found:
            path = Path(folder) / READERS[name].name
            path.write_bytes(contents)
            assert READERS[name].read(path) is not None, name
    return found


def work(
    name: str, seed: int, numbers: range, keep: Path | None, at: Any, answer: Connection
) -> None:
    """Read the inputs with these numbers, in a process of its own."""
    status = Path("/proc/self/statm")
    if status.exists():
        size = int(status.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + ROOM_BYTES, size + ROOM_BYTES))
    tally, started = Tally(), time.monotonic()
    memory = Path("/dev/shm")
    place = memory if memory.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=place) as folder:
        path = Path(folder) / READERS[name].name
        for number, contents in inputs(name, seed, numbers):
            at.value = number
            words = try_one(READERS[name], contents, path, tally)
            if words is not None and keep is not None and max(tally.faults.values()) < 4:
                note(keep, name, number, contents, words)
    tally.seconds = time.monotonic() - started
    tally.peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    answer.send(tally)


def note(keep: Path, name: str, number: int, contents: bytes, words: str) -> None:
    keep.mkdir(parents=True, exist_ok=True)
    stem = f"{name.replace(' ', '-')}-{number}"
    (keep / f"{stem}{Path(READERS[name].name).suffix}").write_bytes(contents)
    (keep / f"{stem}.txt").write_text(words)


def all_inputs(total: int, first: int) -> Iterator[tuple[str, range]]:
    """The numbers of every reader's inputs, in chunks."""
    shares = sum(reader.share for reader in READERS.values())
    for name, reader in READERS.items():
        count = round(total * reader.share / shares)
        for start in range(first, first + count, CHUNK):
            yield name, range(start, min(start + CHUNK, first + count))


def fuzz(total: int, seed: int, first: int, workers: int, keep: Path) -> dict[str, Tally]:
    """Read them all in `workers` processes at a time; what came of it, by reader."""
    for name in READERS:
        seeds_of(name)  # made once, here: processes below are copies of this one
    context = multiprocessing.get_context("fork")
    waiting = list(all_inputs(total, first))[::-1]
    tallies: dict[str, Tally] = defaultdict(Tally)
    running: dict[Connection, tuple[Any, str, range, Any, list[float]]] = {}
    console = Console(stderr=True)
    for _ in track(range(len(waiting)), "chunks", console=console, disable=not console.is_terminal):
        done = False
        while not done:
            while waiting and len(running) < workers:
                name, numbers = waiting.pop()
                mine, its = context.Pipe(False)
                at = context.Value("q", numbers.start, lock=False)
                process = context.Process(target=work, args=(name, seed, numbers, keep, at, its))
                process.start()
                its.close()
                running[mine] = (process, name, numbers, at, [at.value, time.monotonic()])
            for mine in wait(list(running), 1.0):
                assert isinstance(mine, Connection)
                process, name, numbers, at, _ = running.pop(mine)
                done = True
                try:
                    tallies[name].add(mine.recv())
                except EOFError:  # it died
                    tallies[name].add(Tally(inputs=1, crashes=1))
                    lost(name, seed, at.value, keep, "the process died")
                    waiting += [(name, range(at.value + 1, numbers.stop))]
                    done = False
                process.join()
            for process, name, _, at, seen in running.values():
                if at.value != seen[0]:
                    seen[:] = [at.value, time.monotonic()]
                elif time.monotonic() - seen[1] > STUCK_S:
                    tallies[name].hangs += 1
                    lost(name, seed, at.value, keep, "no answer")
                    seen[1] = float("inf")
                    os.kill(process.pid, signal.SIGKILL)
    return tallies


def lost(name: str, seed: int, number: int, keep: Path, words: str) -> None:
    ((_, contents),) = inputs(name, seed, range(number, number + 1))
    note(keep, name, number, contents, words)


@click.command()
@click.option("--inputs", "total", type=click.IntRange(1), default=1_000_000, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--first", type=click.IntRange(0), default=0, help="Number of each first input.")
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(), show_default=True)
@click.option("--reader", "readers", multiple=True, type=click.Choice(list(READERS)))
@click.option(
    "--keep", type=click.Path(path_type=Path), default=Path("fuzzed"), show_default=True,
    help="Folder for inputs that were not refused in words.",
)  # fmt: skip
def main(
    total: int, seed: int, first: int, workers: int, readers: tuple[str, ...], keep: Path
) -> None:
    """Feed damaged files to every reader."""
    torch.set_num_threads(1)
    for name in set(READERS) - set(readers) if readers else ():
        del READERS[name]
    started = time.monotonic()
    tallies = fuzz(total, seed, first, workers, keep)
    table = Table("reader", *("inputs", "refused", "read", "tracebacks", "hangs", "crashes"))
    table.add_column("peak MB")
    table.add_column("ms each")
    for name, tally in tallies.items():
        values = [tally.inputs, tally.refused, tally.read, tally.tracebacks, tally.hangs]
        values += [tally.crashes, tally.peak_mb]
        each = f"{1000 * tally.seconds / max(tally.inputs, 1):.2f}"
        table.add_row(name, *(f"{value:,}" for value in values), each)
    Console().print(table)
    for name, tally in tallies.items():
        for fault, count in tally.faults.most_common():
            click.echo(f"{name}: {fault}, {count} times")
    count = sum(tally.inputs for tally in tallies.values())
    click.echo(f"{count:,} inputs in {time.monotonic() - started:.0f} s")
    sys.exit(any(t.tracebacks + t.hangs + t.crashes for t in tallies.values()))


if __name__ == "__main__":
    main()
