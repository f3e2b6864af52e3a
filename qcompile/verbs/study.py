"""Train every row of a study with several seeds: what `qcompile study` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from qcompile.errors import StudyError
from qcompile.page.document import Document
from qcompile.page.study import study_document
from qcompile.report import progress as bars
from qcompile.report.curves import draw_curves
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.table import Cell, Column, Table
from qcompile.sweep.arguments import Name, Words, ignore
from qcompile.sweep.complete import Pool
from qcompile.sweep.engine import Engine
from qcompile.sweep.study import Study, StudyRequest, run_study
from qcompile.sweep.study.cell import EVALUATION_EPISODES
from qcompile.sweep.study.summary import moments, spread
from qcompile.sweep.study.write_up import figure_panels
from qcompile.verbs.arguments import checked
from qcompile.verbs.reports import Reported


class StudyResult(Reported):
    """The rows of a study in its folder, with earlier trainings.

    `trained` is the number of trainings done now, `there` of those that the folder already had;
    `files` are the other files written, among them `page`.
    """

    def __init__(self, study: Study):
        super().__init__(study.to_dict())
        self.trained, self.there = study.trained, study.there
        self.files, self.page = [*study.files], study.request.page_path
        self._study = study

    def plot(self, figure: str | None = None, style: AnyStyle = None) -> Figure:
        """The learning curves of a figure of the study, or of all its figures side by side.

        Raises:
            FigureError: the style cannot be read.
            StudyError: the folder has no trainings of that figure.
        """
        panels = figure_panels(self._study.request.study, self._study.summaries)
        if figure is not None and figure not in [*panels]:
            raise StudyError(
                f"There are no trainings of figure {figure!r}.",
                f"Figures with trainings: {', '.join(panels)}.",
            )
        return draw_curves([*panels.values()] if figure is None else [panels[figure]], style)

    def document(self, command: str) -> Document:
        return study_document(
            self._study.request.study,
            self._study.summaries,
            self.plot,
            trained=self.trained,
            there=self.there,
            command=command,
        )

    def table(self) -> Table:
        """A row for each row of the study: its scores, mean ± standard deviation over seeds."""
        names = ["row", "seeds", "parameters", "target", "mean at target"]
        columns = [Column(name, right=name != "row") for name in names]
        columns += [
            Column(name, parts=(f"{name}, mean", f"{name}, standard deviation"))
            for name in ("last average", "fresh episodes")
        ]
        rows: list[list[Cell | str]] = []
        for summary in self._study.summaries:
            target, first = summary.row.target, summary.mean_first
            at_target = "-" if target is None else "never" if first is None else str(first)
            rows.append(
                [
                    summary.row.name,
                    Cell.of(len(summary.results)),
                    Cell.of(summary.parameters),
                    Cell.of(target, ".4g"),
                    Cell(at_target, (first,)),
                    *(
                        Cell(spread(scores), moments(scores))
                        for scores in (summary.final, summary.evaluation)
                    ),
                ]
            )
        return Table(columns, rows)


@checked
def study(
    name: Name = "paper",
    *,
    figures: str | Sequence[str] = (),
    rows: str | Sequence[str] = (),
    seeds: int | None = None,
    episodes: int | None = None,
    evaluation: int = EVALUATION_EPISODES,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    out: Name | None = None,
    page: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> StudyResult:
    """Train every row of a study with several seeds, and write up the results.

    The study is "paper", or a .toml file of rows. `figures` and `rows` (beginnings of row names)
    choose rows; `seeds` is the number of seeds of each. `episodes` shortens every training, for a
    first look. Each trained model plays `evaluation` episodes at the end.

    Trainings, results.csv, curves.csv and the figures are written to `out`: by default the folder
    `study`, or the name of the file. Trainings already there are not repeated. The Markdown page is
    by default reproduction.md in `out`. `engine` ("processes", "dask" or "ray", with the cluster at
    `address`) runs `workers` trainings at a time. `imports` are modules that register environments;
    `env` changes arguments of the environments of all rows. `on_note` is told if workers stopped.

    Raises:
        QcompileError: there is no such study, figure or row; an output cannot be written; a
            training fails; Ctrl-C, after which finished trainings are in `out`.
    """
    request = StudyRequest(
        name=name,
        figures=figures,
        rows=rows,
        seeds=seeds,
        episodes=episodes,
        evaluation=evaluation,
        out=out,
        page=page,
        imports=imports,
        env=env or {},
    )
    pool = Pool(engine, address, workers, on_note)
    with bars.progress_bar(f"study {name}", 1, enabled=progress) as show:
        return StudyResult(
            run_study(request, pool, lambda done, count, words: show(done / count, words))
        )
