"""The report of a study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from qcompile.notebook import reward_text
from qcompile.page.document import Block, Document, Picture, Score, Section, Table
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.tables import plural
from qcompile.rl.settings import PACKAGES
from qcompile.sweep.study.rows import Rows
from qcompile.sweep.study.summary import RowSummary, spread


def study_document(
    study: Rows,
    summaries: Sequence[RowSummary],
    draw: Callable[[str, AnyStyle], Figure],
    *,
    trained: int,
    there: int,
    command: str = "",
) -> Document:
    """The report of what a study's folder holds; `draw` draws a figure of it, by its name."""
    best = max(summaries, key=lambda summary: float(summary.evaluation.mean()))
    trainings = sum(len(summary.results) for summary in summaries)
    environments = dict.fromkeys(summary.row.environment for summary in summaries)
    curves: list[Block] = []
    for name, figure in study.figures.items():
        members = [summary for summary in summaries if study.belongs(summary.row, name)]
        if members:
            curves += _curve(name, figure.title, members, draw)
    return Document(
        "study",
        study.title,
        study.about or f"{plural(len(summaries), 'row')} trained in {', '.join(environments)}.",
        Score(
            "best mean reward in fresh episodes",
            reward_text(float(best.evaluation.mean())),
            interval=f"{best.row.title}, {best.row.preset}; {spread(best.evaluation)} over "
            f"{plural(len(best.results), 'seed')}",
        ),
        [
            ("rows", str(len(summaries))),
            ("trainings", str(trainings)),
            ("environments", ", ".join(environments)),
            ("trained now", f"{trained}, {there} were there"),
        ],
        [
            Section("Learning curves", curves),
            Section("Results", [*_results(summaries)]),
            Section("Settings", [*_settings(summaries)]),
        ],
        packages=PACKAGES,
        command=command,
    )


def _curve(
    name: str,
    title: str,
    members: Sequence[RowSummary],
    draw: Callable[[str, AnyStyle], Figure],
) -> list[Block]:
    seeds = plural(max(len(summary.results) for summary in members), "seed")
    words = (
        f"The average reward of the last 20 episodes: the mean over at most {seeds} and, around "
        "it, the standard deviation."
    )
    return [Picture.of(title, lambda style: draw(name, style), words)]


def _results(summaries: Sequence[RowSummary]) -> list[Block]:
    columns = ["row", "seeds", "parameters", "target", "mean at target", "seeds at target"]
    rows = []
    for summary in summaries:
        target, first = summary.row.target, summary.mean_first
        reached = sum(each is not None for each in summary.each_first)
        rows.append(
            [
                summary.row.name,
                str(len(summary.results)),
                f"{summary.parameters:,}",
                "-" if target is None else f"{target:.4g}",
                "-" if target is None else "never" if first is None else f"{first:,}",
                "-" if target is None else f"{reached} of {len(summary.results)}",
                spread(summary.final),
                spread(summary.evaluation),
            ]
        )
    note = (
        "mean at target: the first episode after which the average of the last 20 rewards, "
        "averaged over all seeds, is at the target. The last two columns are mean ± standard "
        "deviation over the seeds."
    )
    best = max(range(len(rows)), key=lambda index: float(summaries[index].evaluation.mean()))
    marked = frozenset({best}) if len(rows) > 1 else frozenset()
    return [
        Table(
            "Results of each row", [*columns, "last average", "fresh episodes"], rows, note, marked
        )
    ]


def _settings(summaries: Sequence[RowSummary]) -> list[Block]:
    rows: list[list[str]] = []
    for summary in summaries:
        row = summary.row
        changes: dict[str, Any] = {**row.changes, **row.arguments}
        words = ", ".join(f"{name} = {value}" for name, value in changes.items()) or "-"
        seeds = ", ".join(map(str, summary.seeds))
        rows.append([row.name, row.environment, row.preset, seeds, words])
    columns = ["row", "environment", "preset", "seeds", "changes of the preset"]
    return [Table("Settings of each row", columns, rows)]
