"""Play a grid of policies, backends, shots and mitigations: what `qcompile evaluate` does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.clashes import beside
from qcompile.deploy.registration import import_modules, module_path
from qcompile.device import Device
from qcompile.errors import StudyError
from qcompile.execution import Backend
from qcompile.output import file_name
from qcompile.page.circuits import Compiled
from qcompile.page.document import Document
from qcompile.page.evaluation import evaluation_document
from qcompile.page.words import without_folders
from qcompile.policy import AnyPolicy
from qcompile.report import progress as bars
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.table import Table
from qcompile.report.tables import grid_table, grid_warnings, plural
from qcompile.sweep.arguments import Name, Shots, Words, ignore, several
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.engine import Engine
from qcompile.sweep.evaluation import run as grids
from qcompile.sweep.evaluation.write_up import figure
from qcompile.verbs.arguments import checked
from qcompile.verbs.reports import Reported

_NAMED = ("policy", "backend", "calibration")
"""What of a result may be named by a path."""


class EvaluationResult(Reported):
    """The results of a grid: `cells` has an object per cell, like that of `qcompile run --json`.

    `played` is the number of cells played now, `there` of those that the folder already had;
    `failures` are those that could not be played. `paths` are the files written, without those of
    the cells.
    """

    def __init__(self, evaluation: grids.Evaluation, paths: Sequence[Path]):
        super().__init__(evaluation.to_dict())
        self.played, self.there, self.paths = evaluation.played, evaluation.there, [*paths]
        self._evaluation = evaluation

    @property
    def cells(self) -> list[dict[str, Any]]:
        """The results; the ideal reference of a policy comes first."""
        cells: list[dict[str, Any]] = self.to_dict()["results"]
        return cells

    @property
    def failures(self) -> tuple[CellFailure, ...]:
        """Why cells could not be played."""
        return self._evaluation.failures

    def check_complete(self) -> None:
        """Check that every cell could be played.

        Raises:
            StudyError: some could not be played; the message says why.
        """
        self._evaluation.check_complete()

    def plot(self, policy: str | None = None, style: AnyStyle = None) -> Figure:
        """Mean rewards and their 95 % intervals, a panel per policy, or of one policy only.

        Policies of one environment share the axis of rewards. More than two numbers of shots have
        an axis, and each backend and mitigation a line.

        Raises:
            FigureError: the style cannot be read.
            StudyError: there is no such policy, or no cell could be played.
        """
        if not self.cells:
            raise StudyError("There is nothing to draw: no cell could be played.")
        names = list(dict.fromkeys(values["policy"] for values in self.cells))
        if policy is not None and policy not in names:
            raise StudyError(
                f"There is no policy {policy!r} in the grid.", f"It has: {', '.join(names)}."
            )
        return figure(self.cells, names if policy is None else [policy], style)

    def document(self, command: str) -> Document:
        names = _page_names(self._evaluation.typed)
        cells = self._evaluation.cells
        played = [cell for cell in cells if not cell.is_reference] or cells
        shots = {cell.shots for cell in played}
        policies = {cell.policy.name: cell.policy for cell in cells}
        for typed in names.keys() & policies:
            policies[typed] = replace(policies[typed], name=names[typed])
        compiled = {
            (cell.policy.name, cell.backend.name, cell.level): Compiled(
                policies[cell.policy.name],
                cell.backend.device,
                cell.level,
                calibration=cell.backend.calibration,
                backend=names.get(cell.backend.name, cell.backend.name),
                shots=cell.shots if len(shots) == 1 else None,
            )
            for cell in played
        }
        renamed = [
            {**cell, **{key: names.get(cell[key], cell[key]) for key in _NAMED}}
            for cell in self.cells
        ]
        return evaluation_document(
            renamed,
            lambda policy, style: figure(renamed, [policy], style),
            [*compiled.values()],
            warnings=self._warnings(renamed, names),
            command=command,
        )

    @property
    def warnings(self) -> list[str]:
        """What a reader must know before the results."""
        return self._warnings(self.cells, {})

    def _warnings(self, cells: Sequence[Mapping[str, Any]], names: Mapping[str, str]) -> list[str]:
        lines = grid_warnings(cells)
        for failure in self.failures:
            cell = failure.name
            for typed, name in names.items():
                cell = cell.replace(file_name(typed), file_name(name))
            lines.append(f"{cell}: {failure.words}")
        return lines

    @property
    def remark(self) -> str:
        if not self.failures:
            return ""
        cells = plural(len(self.failures), "cell")
        return f"{cells} could not be played: check_complete() says why"

    def table(self) -> Table:
        """A row for each cell."""
        return grid_table(self.cells, self.warnings)


@checked
def evaluate(
    policies: Name | AnyPolicy | Sequence[Name | AnyPolicy] = ("lunarlander",),
    backends: Name | Device | Backend | Any | Sequence[Any] = ("ibm_lima",),
    *,
    shots: Shots | Sequence[Shots] = (1024, 8192),
    mitigations: str | Sequence[str] = ("none", "readout"),
    calibrations: Name | Calibration | Sequence[Name | Calibration] = (),
    levels: int | Sequence[int] = (2,),
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
    imports: Name | Sequence[Name] = (),
    env: Mapping[str, Any] | None = None,
    out: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> EvaluationResult:
    """Play every combination of policy, backend, shots, mitigation and level.

    Policies and backends are names, files or objects, one or several; shots None or "exact" are
    exact expectations. Each combination is a cell. Every cell plays the same `episodes`: episode i
    resets with `seed` + i, and is compared with the same policy on `ideal` with exact expectations.
    `calibrations` are used to mitigate on every backend of their device, instead of calibrating
    first. `greedy` takes the most probable action. `imports` are modules or files that register
    environments, in worker processes too; `env` sets arguments of the environments and overrides
    those of the policies.

    If `out` is given, that folder gets the cells, results.json, results.csv and a figure for each
    policy, and cells already in it are not played again. Otherwise nothing is written. `engine`
    ("processes", "dask" or "ray", with the cluster at `address`) runs `workers` cells at a time.
    `on_note` is called with messages for the user.

    Raises:
        QcompileError: a name, a file or a combination cannot be used; an output cannot be written;
            Ctrl-C. Cells that fail on their own are in `failures` instead.
    """
    modules = several(imports)
    import_modules(modules)
    files = beside(reads={option("imports"): [*map(module_path, modules)]})
    with files, _folder(out) as folder, bars.progress_bar("evaluate", 1, enabled=progress) as show:
        evaluation = grids.evaluate(
            policies,
            backends,
            shots=shots,
            mitigations=mitigations,
            calibrations=calibrations,
            levels=levels,
            episodes=episodes,
            seed=seed,
            greedy=greedy,
            env=env,
            out=folder,
            engine=engine,
            address=address,
            workers=workers,
            on_progress=lambda finished, count, words: show(finished / count, words),
            on_note=on_note,
            on_loss=on_note,
        )
    return EvaluationResult(evaluation, () if out is None else evaluation.paths)


@checked
def evaluate_paper(
    *,
    episodes: int = 100,
    seed: int = 0,
    out: Name = "evaluation",
    page: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> EvaluationResult:
    """Play the paper's device tests as `evaluate` plays a grid, and write up the results.

    If every cell could be played, devices.png and the Markdown page are written; the page is by
    default devices.md in `out`.

    Raises:
        QcompileError: as for `evaluate`.
    """
    with bars.progress_bar("evaluate", 1, enabled=progress) as show:
        evaluation = grids.evaluate_paper(
            episodes=episodes,
            seed=seed,
            out=out,
            page=page,
            engine=engine,
            address=address,
            workers=workers,
            on_progress=lambda finished, count, words: show(finished / count, words),
            on_loss=on_note,
        )
    return EvaluationResult(evaluation, evaluation.paths)


def _page_names(typed: Iterable[str]) -> dict[str, str]:
    """What a page calls what was typed: paths by their files, numbered if two have one name."""
    names: dict[str, str] = {}
    for path in sorted(typed):
        name = without_folders(path)
        same = sum(without_folders(other) == name for other in names)
        names[path] = f"{name} ({same + 1})" if same else name
    return names


@contextmanager
def _folder(out: Name | None) -> Iterator[Path]:
    """The folder of an evaluation: `out`, or a temporary one that is removed afterwards."""
    if out is not None:
        yield Path(out)
        return
    with TemporaryDirectory(prefix="qcompile-") as folder:
        try:
            yield Path(folder)
        except StudyError as error:
            if not isinstance(error.__context__, KeyboardInterrupt):
                raise
            raise StudyError(
                str(error).splitlines()[0], "With out=FOLDER, finished cells are kept."
            ) from None
