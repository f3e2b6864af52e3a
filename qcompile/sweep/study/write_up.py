"""Write up a study's folder: CSV files, figures, and the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qcompile.errors import StudyError
from qcompile.report.curves import Curve, CurvePanel, draw_curves
from qcompile.sweep.pages import link, write_files
from qcompile.sweep.study.cell import folder_of
from qcompile.sweep.study.page import page
from qcompile.sweep.study.request import StudyRequest
from qcompile.sweep.study.rows import Cell, Row, Rows
from qcompile.sweep.study.summary import RowSummary, curve_episodes, curves_csv, results_csv


def summaries(rows: Sequence[Row], path: Path) -> list[RowSummary]:
    """The rows that have trainings in the folder, with all of these in the order of seeds."""
    folder, stored = folder_of(path), []
    for row in rows:
        files = folder.cells.glob(f"{row.name}-seed*.json")
        seeds = [file.stem.rpartition("-seed")[2] for file in files]
        cells = [Cell(row, seed) for seed in sorted(int(s) for s in seeds if s.isdecimal())]
        results = folder.finished(cells)
        if results:
            stored.append(RowSummary(row, tuple(results.values())))
    return stored


def write_up(request: StudyRequest, stored: Sequence[RowSummary]) -> list[Path]:
    """Write results.csv, curves.csv, the figures and the page; their paths.

    Raises:
        OutputError: one of them cannot be written.
        StudyError: there is nothing to write.
    """
    study, folder, page_path = request.study, request.folder, request.page_path
    if not stored:
        raise StudyError(f"There are no trainings in {folder}.", "Run the study first.")
    files = {
        folder / "results.csv": results_csv(stored).encode(),
        folder / "curves.csv": curves_csv(stored).encode(),
    }
    panels = figure_panels(study, stored)
    files |= {folder / f"{name}.png": draw_curves([one]).png for name, one in panels.items()}
    repeated = [cell.name for cell in request.cells()]
    at = link(folder, page_path)
    text = page(study, stored, request.command, repeated, at, _versions(stored))
    files[page_path] = text.encode()
    return write_files(files)


def figure_panels(study: Rows, stored: Sequence[RowSummary]) -> dict[str, CurvePanel]:
    """The learning curves of each figure that has trainings, by figure name.

    Curves with the same preset as the first row are solid, others dashed.
    """
    panels = {}
    for name, figure in study.figures.items():
        members = [summary for summary in stored if study.belongs(summary.row, name)]
        if members:
            first = next(row.preset for row in study.rows if study.belongs(row, name))
            curves = [_curve(summary, first) for summary in members]
            targets = [s.row.target for s in members if s.row.target is not None]
            target = targets[0] if targets else None
            panels[name] = CurvePanel(figure.title, curves, target, figure.last_episode)
    return panels


def _curve(summary: RowSummary, solid: str) -> Curve:
    averages = summary.averages
    episodes = curve_episodes(averages.shape[1])
    mean, spread = averages.mean(axis=0)[episodes - 1], averages.std(axis=0)[episodes - 1]
    row = summary.row
    return Curve(
        f"{row.title}, {row.preset}",
        row.group,
        row.preset != solid,
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
