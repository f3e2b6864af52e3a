"""Run a study in a folder: choose its rows, train what is missing, write everything up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from qcompile.errors import StudyError
from qcompile.output import check_writable
from qcompile.sweep.arguments import Name, Words, ignore, no_progress, several
from qcompile.sweep.complete import OnProgress, Pool, complete
from qcompile.sweep.engine import Engine
from qcompile.sweep.study.cell import EVALUATION_EPISODES, CellResult, folder_of, run_cell
from qcompile.sweep.study.paper import rows as every_row
from qcompile.sweep.study.paper import rows_of, shortened
from qcompile.sweep.study.rows import Cell, Row, cells
from qcompile.sweep.study.summary import RowSummary
from qcompile.sweep.study.write_up import summaries, write_up

STUDIES = ("paper",)


@dataclass(frozen=True, eq=False)
class Study:
    """What a study's folder holds: a summary for each row with trainings, those of before included.

    `trained` counts the trainings done now, `there` those asked for that the folder had; `files`
    are what was written besides the trainings, `page` among them.
    """

    name: str
    summaries: tuple[RowSummary, ...]
    trained: int
    there: int
    files: tuple[Path, ...]
    page: Path

    def to_dict(self) -> dict[str, Any]:
        """The document of `qcompile study --json`."""
        return {
            "study": self.name,
            "rows": [summary.values() for summary in self.summaries],
            "trained": self.trained,
            "files": [str(path) for path in self.files],
        }


def study(
    name: str = "paper",
    *,
    figures: str | Sequence[str] = (),
    rows: str | Sequence[str] = (),
    seeds: int | None = None,
    episodes: int | None = None,
    evaluation: int = EVALUATION_EPISODES,
    out: Name = "study",
    page: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    on_progress: OnProgress = no_progress,
    on_loss: Words = ignore,
) -> Study:
    """Train every row of a study with several seeds and write up all that the folder holds.

    `figures` and `rows` (beginnings of their names) choose rows, `seeds` their number of seeds.
    `episodes` shortens every training, for a first look; the final models play `evaluation` fresh
    episodes. Trainings, results.csv, curves.csv and a picture for each figure are written to `out`,
    whose trainings are not repeated, and the Markdown page, by default reproduction.md in `out`.
    `engine`, `address` and `workers` are those of `run_all`. `on_progress` follows the trainings,
    `on_loss` is told when workers were lost.

    Raises:
        QcompileError: no such study, figure or row; an output that cannot be written; a training
            that fails; a cluster that is not there; Ctrl-C, after which `out` holds what is
            finished.
    """
    out = Path(out)
    page_path = out / "reproduction.md" if page is None else Path(page)
    chosen = _chosen(name, figures, rows, episodes)
    check_writable(page_path)
    folder = folder_of(out, evaluation)
    folder.check_writable()
    every = cells(chosen, seeds)
    if episodes is not None or evaluation != EVALUATION_EPISODES:
        _check_replaces_nothing(every, out, evaluation)
    completed = complete(
        every,
        folder,
        partial(run_cell, evaluation=evaluation),
        Pool(engine, address, workers, on_loss),
        on_progress,
        describe=_description,
        environments=[row.environment for row in chosen],
        noun="training",
    )
    known = _shortened(every_row(), episodes)
    stored = summaries(known, out)  # what was trained before is written up as well
    files = write_up(stored, out, page_path)
    return Study(name, tuple(stored), completed.run, completed.there, tuple(files), page_path)


def study_rows(
    name: str = "paper",
    *,
    figures: str | Sequence[str] = (),
    rows: str | Sequence[str] = (),
    seeds: int | None = None,
    episodes: int | None = None,
    evaluation: int = EVALUATION_EPISODES,
    out: Name = "study",
) -> list[dict[str, Any]]:
    """The rows that `study` would train: row, environment, seeds, and how many are left to train.

    Raises:
        StudyError: no such study, figure or row.
    """
    folder = folder_of(Path(out), evaluation)
    return [
        {
            "row": row.name,
            "environment": row.environment,
            "seeds": row.seeds if seeds is None else seeds,
            "left": len(folder.missing(cells([row], seeds))),
        }
        for row in _chosen(name, figures, rows, episodes)
    ]


def _chosen(
    name: str, figures: str | Sequence[str], rows: str | Sequence[str], episodes: int | None
) -> list[Row]:
    """The rows of these figures whose names begin with one of `rows`; with none named, all."""
    if name not in STUDIES:
        raise StudyError(f"Unknown study {name!r}.", f"Known: {', '.join(STUDIES)}.")
    beginnings = several(rows)
    members = rows_of(tuple(several(figures)))
    named = [row for row in members if row.name.startswith(tuple(beginnings) or "")]
    if not named:
        raise StudyError(
            f"No row's name begins with {' or '.join(beginnings)}.", "--list shows their names."
        )
    return _shortened(named, episodes)


def _shortened(rows: Sequence[Row], episodes: int | None) -> list[Row]:
    return [row if episodes is None else shortened(row, episodes) for row in rows]


def _check_replaces_nothing(every: Sequence[Cell], out: Path, evaluation: int) -> None:
    """Refuse a first look where a training with other settings is stored.

    Raises:
        StudyError: the file of a cell that is to be trained is there.
    """
    folder = folder_of(out, evaluation)
    stored = [cell for cell in folder.missing(every) if folder.file(cell).exists()]
    if stored:
        raise StudyError(
            f"{out} holds {len(stored)} of these trainings with other settings.",
            "Fewer episodes need a folder of their own: say --out look.",
        )


def _description(result: CellResult) -> str:
    words = f"{result.row}, seed {result.seed}"
    last = result.last_average
    return words if last is None else f"{words}: {last:.1f}"
