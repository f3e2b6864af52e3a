"""Run a study in a folder: train what is missing, write everything up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from qcompile.deploy.environments import close_environments, make_environments
from qcompile.errors import EnvironmentMismatchError
from qcompile.notebook import reward_text
from qcompile.output import check_writable
from qcompile.sweep.arguments import no_progress
from qcompile.sweep.complete import OnProgress, Pool, complete
from qcompile.sweep.study.cell import CellResult, folder_of, run_cell
from qcompile.sweep.study.request import StudyRequest
from qcompile.sweep.study.rows import Cell, Row
from qcompile.sweep.study.summary import RowSummary
from qcompile.sweep.study.write_up import summaries, write_up


@dataclass(frozen=True, eq=False)
class Study:
    """The result of a study: a summary for each row with trainings, including earlier ones.

    `trained` is the number of trainings done now, `there` of those that the folder already had;
    `files` are the files written, without those of the trainings.
    """

    request: StudyRequest
    summaries: tuple[RowSummary, ...]
    trained: int
    there: int
    files: tuple[Path, ...]

    def to_dict(self) -> dict[str, Any]:
        """The document of `qcompile study --json`."""
        return {
            "study": self.request.study.name,
            "rows": [summary.values() for summary in self.summaries],
            "trained": self.trained,
            "files": [str(path) for path in self.files],
        }


def run_study(request: StudyRequest, pool: Pool, on_progress: OnProgress = no_progress) -> Study:
    """Train the cells that the folder lacks, and write up everything in it.

    Raises:
        QcompileError: there is no such study, figure, row, environment or cluster; an output cannot
            be written; a training fails; Ctrl-C, after which finished trainings are in the folder.
    """
    cells = request.cells()
    folder = folder_of(request.folder, request.evaluation)
    request.check_clashes()
    check_writable(request.page_path)
    folder.check_writable()
    request.check_replaces_nothing()
    _check_environments(folder.missing(cells))
    completed = complete(
        cells,
        folder,
        partial(run_cell, evaluation=request.evaluation),
        pool,
        on_progress,
        describe=_description,
        environments=[cell.row.environment for cell in cells],
        noun="training",
    )
    # Earlier trainings are written up too.
    stored = summaries(request.changed(request.study.rows), request.folder)
    files = write_up(request, stored)
    return Study(request, tuple(stored), completed.run, completed.there, tuple(files))


def _check_environments(cells: Sequence[Cell]) -> None:
    """Raise EnvironmentMismatchError if the environment of a training cannot be made."""
    rows: dict[tuple[str, str], Row] = {}
    for cell in cells:
        rows.setdefault((cell.row.environment, repr(cell.row.arguments)), cell.row)
    for row in rows.values():
        try:
            environments = make_environments(row.environment, 1, arguments=row.arguments)
        except EnvironmentMismatchError as error:
            raise error.with_hints(f"It is the environment of row {row.name}.") from error
        close_environments(environments)


def _description(result: CellResult) -> str:
    words = f"{result.row}, seed {result.seed}"
    last = result.last_average
    return words if last is None else f"{words}: {reward_text(last)}"
