"""Feed damaged files to every reader, and count which ones are refused with an explanation.

    python benchmarks/fuzz.py --inputs 1000000 --workers 2

Input i of a reader follows from --seed and i alone, so a run can be cut into parts with --first.
They are read in processes that may take 1 GB more than they start with; one that gets stuck or dies
is recorded, and another one takes over. Only a QcompileError counts as refused. Whatever is not
refused in words is kept in --keep, with the traceback. A run that is stopped prints what it has
done so far.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import click
import torch
from fuzz_readers import READERS, Reader
from mutations import mutated
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from qcompile.errors import QcompileError

STUCK_S = 60
ROOM_BYTES = 2**30
CHUNK = 2000


@dataclass
class Tally:
    """The outcomes of a reader's inputs; `faults` has a traceback of each kind of failure."""

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
    """Read one input; return the traceback if the refusal is not explained."""
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(contents)
    tally.inputs += 1
    try:
        result = reader.read(path)
    except QcompileError:
        tally.refused += 1
    except Exception as error:
        tally.tracebacks += 1
        words = traceback.format_exc()
        frame = traceback.extract_tb(error.__traceback__)[-1]
        tally.faults[f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}"] += 1
        return words
    else:
        tally.read += result is not None
        tally.refused += result is None
    return None


def inputs(name: str, seed: int, numbers: range) -> Iterator[tuple[int, bytes]]:
    reader, seeds = READERS[name], seeds_of(name)
    for number in numbers:
        yield number, mutated(reader.kind, f"{seed} {name} {number}", seeds)


@cache
def seeds_of(name: str) -> list[bytes]:
    seeds = READERS[name].seeds()
    with tempfile.TemporaryDirectory() as folder:  # what is damaged must be whole before
        for contents in seeds:
            path = Path(folder) / READERS[name].name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(contents)
            assert READERS[name].read(path) is not None, name
    return seeds


def work(
    name: str, seed: int, numbers: range, keep: Path | None, at: Any, answer: Connection
) -> None:
    """Read the inputs with these numbers, in a separate process."""
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
    """The numbers of every reader's inputs, in chunks: some of every reader, then more of each."""
    shares = sum(reader.share for reader in READERS.values())
    counts = {name: round(total * reader.share / shares) for name, reader in READERS.items()}
    for start in range(0, max(counts.values()), CHUNK):
        for name, count in counts.items():
            if start < count:
                yield name, range(first + start, first + min(start + CHUNK, count))


def fuzz(
    total: int, seed: int, first: int, workers: int, keep: Path, tallies: dict[str, Tally]
) -> None:
    """Read all inputs in `workers` processes; `tallies` gets the outcomes by reader."""
    for name in READERS:
        seeds_of(name)  # made once, here: processes below are copies of this one
    context = multiprocessing.get_context("fork")
    waiting = list(all_inputs(total, first))[::-1]
    running: dict[Connection, tuple[Any, str, range, Any, list[float]]] = {}
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal) as progress:
        bar = progress.add_task("chunks", total=len(waiting))
        while waiting or running:
            while waiting and len(running) < workers:
                name, numbers = waiting.pop()
                mine, its = context.Pipe(False)
                at = context.Value("q", numbers.start, lock=False)
                given = (name, seed, numbers, keep, at, its)
                process = context.Process(target=work, args=given, daemon=True)
                process.start()
                its.close()
                running[mine] = (process, name, numbers, at, [at.value, time.monotonic()])
            for mine in wait(list(running), 1.0):
                assert isinstance(mine, Connection)
                process, name, numbers, at, _ = running.pop(mine)
                try:
                    tallies[name].add(mine.recv())
                    progress.advance(bar)
                except EOFError:  # it died
                    tallies[name].add(Tally(inputs=1, crashes=1))
                    lost(name, seed, at.value, keep, "the process died")
                    waiting += [(name, range(at.value + 1, numbers.stop))]
                process.join()
            for process, name, _, at, last_progress in running.values():
                if at.value != last_progress[0]:
                    last_progress[:] = [at.value, time.monotonic()]
                elif time.monotonic() - last_progress[1] > STUCK_S:
                    tallies[name].hangs += 1
                    lost(name, seed, at.value, keep, "no answer")
                    last_progress[1] = float("inf")
                    os.kill(process.pid, signal.SIGKILL)


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
    tallies: dict[str, Tally] = defaultdict(Tally)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        fuzz(total, seed, first, workers, keep, tallies)
    except KeyboardInterrupt:
        click.echo("stopped: the table shows what was finished", err=True)
    table = Table("reader", *("inputs", "refused", "read", "tracebacks", "hangs", "crashes"))
    table.add_column("peak MB")
    table.add_column("ms each")
    for name, tally in tallies.items():
        values = [tally.inputs, tally.refused, tally.read, tally.tracebacks, tally.hangs]
        values += [tally.crashes, tally.peak_mb]
        each = f"{1000 * tally.seconds / max(tally.inputs, 1):.2f}"
        table.add_row(name, *(f"{value:,}" for value in values), each)
    Console(width=100).print(table)
    for name, tally in tallies.items():
        for fault, count in tally.faults.most_common():
            click.echo(f"{name}: {fault}, {count} times")
    count = sum(tally.inputs for tally in tallies.values())
    click.echo(f"{count:,} inputs in {time.monotonic() - started:.0f} s")
    sys.exit(any(t.tracebacks + t.hangs + t.crashes for t in tallies.values()))


if __name__ == "__main__":
    main()
