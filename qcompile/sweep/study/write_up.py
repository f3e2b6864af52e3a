"""What a study's folder holds, written up: CSV, a picture for each figure, and the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qcompile.errors import StudyError
from qcompile.report.curves import Curve, draw_curves
from qcompile.sweep.pages import link, write_files
from qcompile.sweep.study.cell import folder_of
from qcompile.sweep.study.page import page
from qcompile.sweep.study.paper import belongs, figures
from qcompile.sweep.study.rows import Cell, Row
from qcompile.sweep.study.summary import RowSummary, curve_episodes, curves_csv, results_csv

_LAST_EPISODES = {"lunarlander": 2500}


def summaries(rows: Sequence[Row], path: Path) -> list[RowSummary]:
    """The rows of which the folder holds trainings, with all of these, in the order of seeds."""
    folder, stored = folder_of(path), []
    for row in rows:
        files = folder.cells.glob(f"{row.name}-seed*.json")
        seeds = [file.stem.rpartition("-seed")[2] for file in files]
        cells = [Cell(row, seed) for seed in sorted(int(s) for s in seeds if s.isdecimal())]
        results = folder.finished(cells)
        if results:
            stored.append(RowSummary(row, tuple(results.values())))
    return stored


def write_up(stored: Sequence[RowSummary], folder: Path, page_path: Path) -> list[Path]:
    """Write results.csv, curves.csv, a picture for each figure and the page; their paths.

    Raises:
        OutputError: one of them cannot be written.
        StudyError: there is nothing to write.
    """
    if not stored:
        raise StudyError(f"There are no trainings in {folder}.", "Run the study first.")
    files = {
        folder / "results.csv": results_csv(stored).encode(),
        folder / "curves.csv": curves_csv(stored).encode(),
    }
    pictures = draw_figures(stored)
    files |= {folder / f"{name}.png": picture for name, picture in pictures.items()}
    files[page_path] = page(stored, link(folder, page_path), _versions(stored)).encode()
    return write_files(files)


def draw_figures(stored: Sequence[RowSummary]) -> dict[str, bytes]:
    """The learning curves of each figure that has trainings, as PNG files by its name."""
    pictures = {}
    for name, figure in figures().items():
        members = [summary for summary in stored if belongs(summary.row, name)]
        if members:
            curves, target = [_curve(summary) for summary in members], members[0].row.target
            last = _LAST_EPISODES.get(name)
            pictures[name] = draw_curves(figure.title, curves, target, last)
    return pictures


def _curve(summary: RowSummary) -> Curve:
    averages = summary.averages
    episodes = curve_episodes(averages.shape[1])
    mean, spread = averages.mean(axis=0)[episodes - 1], averages.std(axis=0)[episodes - 1]
    row = summary.row
    return Curve(
        f"{row.title}, {row.preset}",
        row.title.removesuffix(", large"),
        row.preset == "tuned",
        episodes,
        mean,
        mean - spread,
        mean + spread,
    )


def _versions(stored: Sequence[RowSummary]) -> dict[str, str]:
    results = [result for summary in stored for result in summary.results]
    return {
        name: " and ".join(sorted({result.versions.get(name, "?") for result in results}))
        for name in results[0].versions
    }
