"""Train every row of a study with several seeds: what `qcompile study` does."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.deploy.registration import import_modules
from qcompile.errors import StudyError
from qcompile.report import progress as bars
from qcompile.report.figure import Figure
from qcompile.sweep.arguments import Name, Words, ignore, several
from qcompile.sweep.engine import Engine
from qcompile.sweep.study import run as studies
from qcompile.sweep.study.cell import EVALUATION_EPISODES
from qcompile.sweep.study.run import study_rows as study_rows
from qcompile.sweep.study.summary import spread
from qcompile.sweep.study.write_up import draw_figures
from qcompile.verbs.arguments import checked
from qcompile.verbs.results import Result


class StudyResult(Result):
    """What a study's folder holds: its rows, trainings of before included.

    `trained` counts the trainings done now, `there` those asked for that the folder had; `files`
    are what was written besides the trainings, `page` among them.
    """

    def __init__(self, study: studies.Study):
        super().__init__(study.to_dict())
        self.trained, self.there = study.trained, study.there
        self.files, self.page = [*study.files], study.page
        self._summaries = study.summaries

    def plot(self, figure: str | None = None) -> Figure:
        """The learning curves of a figure of the study, by default its first.

        Raises:
            StudyError: the folder holds no training of such a figure.
        """
        pictures = draw_figures(self._summaries)
        name = next(iter(pictures)) if figure is None else figure
        if name not in pictures:
            raise StudyError(
                f"There are no trainings of a figure {name!r}.",
                f"There are: {', '.join(pictures)}.",
            )
        return Figure(pictures[name])

    @property
    def table(self) -> tuple[list[str], list[list[str]]]:
        columns = ["row", "seeds", "parameters", "target", "mean at target"]
        rows = [
            [
                summary.row.name,
                str(len(summary.results)),
                str(summary.parameters),
                f"{summary.row.target:.4g}",
                str(summary.mean_first or "never"),
                spread(summary.final),
                spread(summary.evaluation),
            ]
            for summary in self._summaries
        ]
        return [*columns, "last average", "fresh episodes"], rows


@checked
def study(
    name: str = "paper",
    *,
    figures: str | Sequence[str] = (),
    rows: str | Sequence[str] = (),
    seeds: int | None = None,
    episodes: int | None = None,
    evaluation: int = EVALUATION_EPISODES,
    imports: Name | Sequence[Name] = (),
    out: Name = "study",
    page: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> StudyResult:
    """Train every row of a study with several seeds and write up all that the folder holds.

    `figures` and `rows` (beginnings of their names) choose rows, `seeds` their number of seeds.
    `episodes` shortens every training, for a first look; the final models play `evaluation` fresh
    episodes. Trainings, results.csv, curves.csv and a picture for each figure are written to `out`,
    whose trainings are not repeated, and the Markdown page, by default reproduction.md in `out`.
    Trainings run side by side by `engine`: "processes", "dask" or "ray", the cluster at `address`,
    with so many `workers`, which import the modules `imports` too. `on_note` is told when workers
    were lost.

    Raises:
        QcompileError: no such study, figure or row; an output that cannot be written; a training
            that fails; Ctrl-C, after which `out` holds what is finished.
    """
    import_modules(several(imports))
    with bars.progress_bar(f"study {name}", 1, enabled=progress) as show:
        result = studies.study(
            name,
            figures=figures,
            rows=rows,
            seeds=seeds,
            episodes=episodes,
            evaluation=evaluation,
            out=out,
            page=page,
            engine=engine,
            address=address,
            workers=workers,
            on_progress=lambda finished, count, words: show(finished / count, words),
            on_loss=on_note,
        )
    return StudyResult(result)
