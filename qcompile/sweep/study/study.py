"""Run a study in a folder, and write it up."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from qcompile.errors import StudyError
from qcompile.output import write_file
from qcompile.report.curves import Curve, draw_curves
from qcompile.sweep.study.cell import read_cell
from qcompile.sweep.study.page import page
from qcompile.sweep.study.paper import FIGURES, shown_in
from qcompile.sweep.study.rows import Cell, Row, cells
from qcompile.sweep.study.summary import RowSummary, curves_csv, results_csv, shown_episodes

_MOST_SHOWN = {"lunarlander": 2500}


def cells_folder(folder: Path) -> Path:
    """Where a study in `folder` keeps its trainings."""
    return folder / "cells"


def missing_cells(
    rows: Sequence[Row], folder: Path, seeds: int | None, evaluation: int
) -> list[Cell]:
    """The cells whose training, with these very settings, the folder does not hold yet."""
    kept = cells_folder(folder)
    return [cell for cell in cells(rows, seeds) if read_cell(cell, kept, evaluation) is None]


def check_replaces_nothing(missing: Sequence[Cell], folder: Path) -> None:
    """Refuse a first look where a training with other settings has been kept.

    Raises:
        StudyError: a file of a missing cell is there.
    """
    there = [cell for cell in missing if (cells_folder(folder) / f"{cell.name}.json").exists()]
    if there:
        raise StudyError(
            f"{folder} holds {len(there)} of these trainings with other settings.",
            "Fewer episodes need a folder of their own: say --out look.",
        )


def summaries(rows: Sequence[Row], folder: Path) -> list[RowSummary]:
    """The rows of which the folder holds trainings, with all of these, in the order of seeds."""
    found = []
    for row in rows:
        files = cells_folder(folder).glob(f"{row.name}-seed*.json")
        seeds = sorted(int(path.stem.rpartition("-seed")[2]) for path in files)
        results = [read_cell(Cell(row, seed), cells_folder(folder)) for seed in seeds]
        kept = tuple(result for result in results if result is not None)
        if kept:
            found.append(RowSummary(row, kept))
    return found


def write_up(found: Sequence[RowSummary], folder: Path, page_path: Path) -> list[Path]:
    """Write results.csv, curves.csv, a picture for each figure and the page; their paths.

    Raises:
        OutputError: one of them cannot be written.
        StudyError: there is nothing to write.
    """
    if not found:
        raise StudyError(f"There are no trainings in {folder}.", "Run the study first.")
    files = {
        folder / "results.csv": results_csv(found).encode(),
        folder / "curves.csv": curves_csv(found).encode(),
    }
    for figure, title in FIGURES.items():
        shown = [summary for summary in found if shown_in(summary.row, figure)]
        if shown:
            files[folder / f"{figure}.png"] = draw_curves(
                title, [_curve(s) for s in shown], shown[0].row.target, _MOST_SHOWN.get(figure)
            )
    seen_from_page = os.path.relpath(folder.resolve(), page_path.resolve().parent)
    files[page_path] = page(found, Path(seen_from_page).as_posix(), _versions(found)).encode()
    for path, contents in files.items():
        write_file(path, contents)
    return list(files)


def _curve(summary: RowSummary) -> Curve:
    averages = summary.averages
    shown = shown_episodes(averages.shape[1])
    mean, spread = averages.mean(axis=0)[shown - 1], averages.std(axis=0)[shown - 1]
    row = summary.row
    return Curve(
        f"{row.title}, {row.preset}",
        row.title.removesuffix(", large"),
        row.preset == "tuned",
        shown,
        mean,
        mean - spread,
        mean + spread,
    )


def _versions(found: Sequence[RowSummary]) -> dict[str, str]:
    results = [result for summary in found for result in summary.results]
    return {
        name: " and ".join(sorted({result.versions.get(name, "?") for result in results}))
        for name in results[0].versions
    }
