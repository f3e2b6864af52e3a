"""Complete a folder of cells: run what it lacks, and write every result as soon as it is there."""

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
    """The results by the names of their cells: `there` were in the folder, the others were run."""

    results: dict[str, R]
    there: int
    failures: list[CellFailure] = field(default_factory=list)

    @property
    def run(self) -> int:
        """How many cells were run."""
        return len(self.results) - self.there


class OnProgress(Protocol):
    """Called with the cells that are finished, the number of all, and words about the last."""

    def __call__(self, finished: int, count: int, words: str, /) -> None: ...


@dataclass(frozen=True)
class Pool:
    """What runs the cells side by side.

    `address` is that of a running Dask scheduler or Ray cluster; without it one is started.
    `workers` is their number, by default one for each core, or all that the cluster has. `on_loss`
    is told, in words, when workers were lost.
    """

    engine: Engine = "processes"
    address: str | None = None
    workers: int | None = None
    on_loss: Callable[[str], None] = lambda words: None

    @property
    def is_this_process(self) -> bool:
        """Whether cells are run here, one by one."""
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
    """Run the cells that the folder lacks, and give the results of all.

    A cell that fails in words is not written, and leaves the others alone. `describe` says in a few
    words what came of a cell; `noun` is what messages call one. Workers know what is known here of
    `environments`.

    Raises:
        EnvironmentMismatchError: an environment cannot be sent to workers.
        OutputError: a result cannot be written.
        StudyError: Ctrl-C, or what `run_all` raises; what is finished stays in the folder.
        MissingExtraError: the engine's package is not installed.
    """
    results = folder.finished(cells)
    completed = Completed(results, len(results))
    count = len(cells)
    there = f"{len(results)} of {count} {noun}s are there" if results else ""
    on_progress(len(results), count, there)

    def keep(cell: C, outcome: R | CellFailure) -> None:
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
            keep,
            engine=pool.engine,
            address=pool.address,
            workers=pool.workers,
            on_loss=pool.on_loss,
            noun=noun,
        )
    except KeyboardInterrupt:
        raise StudyError(
            f"Interrupted: {len(results)} of {count} {noun}s are finished.",
            f"What is finished is in {folder.path}; the same command resumes from there.",
        ) from None
    return completed
