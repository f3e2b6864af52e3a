"""Complete a folder of cells: run those that it lacks, and write each result at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from pydantic import BaseModel

from qcompile.deploy.registration import with_environments
from qcompile.errors import StudyError
from qcompile.sweep.engine import Engine, Named, run_all
from qcompile.sweep.folder import Folder

C = TypeVar("C", bound=Named)
R = TypeVar("R", bound=BaseModel)


@dataclass(frozen=True)
class CellFailure:
    """Why a cell could not be run, in words."""

    name: str
    words: str


@dataclass
class Completed(Generic[R]):
    """The results by cell name; `there` of them were in the folder before, the others were run."""

    results: dict[str, R]
    there: int
    failures: list[CellFailure] = field(default_factory=list)

    @property
    def run(self) -> int:
        """How many cells were run."""
        return len(self.results) - self.there


class OnProgress(Protocol):
    """Called with the number of finished cells, the number of all, and words about the last."""

    def __call__(self, finished: int, count: int, words: str, /) -> None: ...


@dataclass(frozen=True)
class Pool:
    """Where cells run in parallel.

    `address` is that of a running Dask scheduler or Ray cluster; without it one is started.
    `workers` is their number, by default one per core, or all that the cluster has. `on_loss` is
    called with a message if workers stopped.
    """

    engine: Engine = "processes"
    address: str | None = None
    workers: int | None = None
    on_loss: Callable[[str], None] = lambda words: None

    @property
    def is_this_process(self) -> bool:
        """Whether cells are run one by one in this process."""
        return self.engine == "processes" and self.workers == 1


def complete(
    cells: Sequence[C],
    folder: Folder[C, R],
    run: Callable[[C], R | CellFailure],
    pool: Pool,
    on_progress: OnProgress,
    *,
    describe: Callable[[R], str],
    environments: Iterable[str] = (),
    noun: str = "cell",
) -> Completed[R]:
    """Run the cells that the folder lacks, and return the results of all.

    A cell that returns a `CellFailure` is not written, and the others still run. `describe` gives a few
    words about a result; `noun` is what messages call a cell. Workers get the registrations of
    `environments`.

    Raises:
        EnvironmentMismatchError: an environment cannot be sent to workers.
        OutputError: a result cannot be written.
        StudyError: Ctrl-C, or an error of `run_all`; finished results stay in the folder.
        MissingExtraError: the engine's package is not installed.
    """
    results = folder.finished(cells)
    completed = Completed(results, len(results))
    count = len(cells)
    words = f"{len(results)} of {count} {noun}s loaded" if results else ""
    on_progress(len(results), count, words)

    def store(cell: C, outcome: R | CellFailure) -> None:
        if isinstance(outcome, CellFailure):
            completed.failures.append(outcome)
            words = f"{cell.name} failed"
        else:
            folder.write(cell, outcome)
            results[cell.name] = outcome
            words = describe(outcome)
        on_progress(len(results) + len(completed.failures), count, words)

    waiting = [cell for cell in cells if cell.name not in results]
    if waiting and not pool.is_this_process:
        run = with_environments(run, environments)
    try:
        run_all(
            waiting,
            run,
            store,
            engine=pool.engine,
            address=pool.address,
            workers=pool.workers,
            on_loss=pool.on_loss,
            noun=noun,
        )
    except KeyboardInterrupt:
        raise StudyError(
            f"Interrupted: {len(results)} of {count} {noun}s finished.",
            f"They are in {folder.path}; the same command resumes with the others.",
        ) from None
    return completed
