"""Evaluate policies on backends: play a grid, compare its cells, and write a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import chain, product
from os import fspath
from pathlib import Path
from typing import Any

from qcompile.calibration import Calibration, age_warnings, load_calibration
from qcompile.caller import option
from qcompile.clashes import Named, check_clashes
from qcompile.deploy.environments import close_environments, policy_environments
from qcompile.deploy.settings import MITIGATIONS
from qcompile.device import Device, backend_path
from qcompile.errors import CalibrationError, DeviceError, StudyError
from qcompile.execution import Backend, Executor, load_backend
from qcompile.notebook import reward_text
from qcompile.output import check_writable
from qcompile.policy import AnyPolicy, Network, load_policy
from qcompile.policy.arguments import with_arguments
from qcompile.policy.files import policy_path
from qcompile.sweep.arguments import (
    Name,
    Shots,
    Words,
    ignore,
    no_progress,
    several,
    shots_of,
)
from qcompile.sweep.complete import CellFailure, Completed, OnProgress, Pool, complete
from qcompile.sweep.engine import Engine
from qcompile.sweep.evaluation.calibrations import CalibrationFile
from qcompile.sweep.evaluation.cell import CellResult, check_calibrations, folder_of, run_cell
from qcompile.sweep.evaluation.grid import (
    REFERENCE,
    Cell,
    grid,
    left_out,
    rename_duplicates,
)
from qcompile.sweep.evaluation.page import write_devices
from qcompile.sweep.evaluation.paper import paper_cells
from qcompile.sweep.evaluation.summary import results
from qcompile.sweep.evaluation.write_up import RESULTS, figure_name, write_figures, write_results
from qcompile.validation import listed


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The result of an evaluation: `summaries` has an object for each cell that could be played.

    `played` is the number of cells played now, `there` of those that the folder already had;
    `failures` are those that could not be played. `paths` are the files written, without those of
    the cells. `typed` are the names of policies, backends and calibrations that were typed: they
    may be paths.
    """

    cells: tuple[Cell, ...]
    summaries: tuple[dict[str, Any], ...]
    played: int
    there: int
    failures: tuple[CellFailure, ...]
    paths: tuple[Path, ...]
    typed: frozenset[str] = frozenset()

    def to_dict(self) -> dict[str, Any]:
        """The document of `qcompile evaluate --json`."""
        return {"results": [*self.summaries]}

    def check_complete(self) -> None:
        """Check that every cell could be played.

        Raises:
            StudyError: some could not be played; the message says why.
        """
        if self.failures:
            raise StudyError(
                f"{len(self.failures)} of {len(self.cells)} cells could not be played.",
                *chain.from_iterable(map(_failure_lines, self.failures)),
            )


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
    env: Mapping[str, Any] | None = None,
    out: Name = "evaluation",
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    on_progress: OnProgress = no_progress,
    on_note: Words = ignore,
    on_loss: Words = ignore,
) -> Evaluation:
    """Play every combination of policy, backend, shots, mitigation and level.

    The arguments are those of `qcompile.evaluate`, and `out` is always written to. `engine`,
    `address` and `workers` are those of `run_all`. `on_progress` follows the cells, `on_note` is
    told what is left out and which calibrations are old, `on_loss` if workers stopped.

    Raises:
        QcompileError: a name, a file or a combination cannot be used; an output cannot be written;
            there is no cluster at the address; Ctrl-C, after which finished cells are in `out`.
            Cells that fail on their own are in `failures` instead.
    """
    out = Path(out)
    sides = (
        [shots_of(count) for count in several(shots)],
        [_known_mitigation(name) for name in several(mitigations)],
        several(levels),
    )
    given = several(policies)
    loaded = [with_arguments(load_policy(policy), env) for policy in given]
    words = [policy.name if isinstance(policy, AnyPolicy) else fspath(policy) for policy in given]
    different = rename_duplicates(words, loaded)
    opened = [_backend(backend) for backend in several(backends)]
    files = [_calibration_file(calibration) for calibration in several(calibrations)]
    cells = grid(
        different, opened, *sides, calibrations=files, episodes=episodes, seed=seed, greedy=greedy
    )
    reads: Named = {
        "the policy": [*map(policy_path, given)],
        option("backend"): [*map(backend_path, several(backends))],
        option("calibration"): [
            Path(file) for file in several(calibrations) if not isinstance(file, Calibration)
        ],
    }
    _check_clashes(cells, out, reads, [figure_name(policy.name) for policy in different])
    for policy in different:
        close_environments(policy_environments(policy, 1))
    check_calibrations(cells)
    now = datetime.now(UTC)
    for file in files:
        for note in age_warnings(file.name, file.calibration, now):
            on_note(note)
    for why in _left_out(different, opened, *sides):
        on_note(f"Left out: {why}.")
    pool = Pool(engine, address, workers, on_loss)
    completed = _completed(cells, out, pool, on_progress)
    evaluation = _written(cells, completed, out, lambda objects: write_figures(objects, out))
    names = {policy.name for policy in different}.intersection(words)
    typed = (*names, *(backend.name for backend in opened), *(file.name for file in files))
    return replace(evaluation, typed=frozenset(typed))


def _left_out(
    policies: Sequence[AnyPolicy],
    backends: Sequence[Backend],
    *sides: Any,
) -> list[str]:
    """The reasons why combinations of the sides are left out of the grid."""
    combinations = product([backend.name for backend in backends], *sides)
    networks = [policy.name for policy in policies if isinstance(policy, Network)]
    words: list[str] = []
    if len(networks) < len(policies):
        words += dict.fromkeys(left_out(backends, *sides).values())
    if networks and {*combinations} != {REFERENCE}:
        words.append(
            f"{listed(networks)} except on ideal with exact expectations: a network has no circuits"
        )
    return words


def evaluate_paper(
    *,
    episodes: int = 100,
    seed: int = 0,
    out: Name = "evaluation",
    page: Name | None = None,
    engine: Engine = "processes",
    address: str | None = None,
    workers: int | None = None,
    on_progress: OnProgress = no_progress,
    on_loss: Words = ignore,
) -> Evaluation:
    """Play the paper's device tests as `evaluate` plays a grid, and write up the results.

    If every cell could be played, devices.png and the Markdown page are written; the page is by
    default devices.md in `out`.

    Raises:
        QcompileError: as for `evaluate`.
    """
    out = Path(out)
    page_path = out / "devices.md" if page is None else Path(page)
    cells = paper_cells(episodes, seed)
    page_word = f"devices.md of {option('out')}" if page is None else option("page")
    _check_clashes(cells, out, {}, ["devices.png"], {page_word: page_path})
    check_writable(page_path)
    pool = Pool(engine, address, workers, on_loss)
    completed = _completed(cells, out, pool, on_progress)

    def write(objects: Sequence[dict[str, Any]]) -> list[Path]:
        if completed.failures:
            return []
        return write_devices(cells, completed.results, out, page_path)

    return _written(cells, completed, out, write)


def _check_clashes(
    cells: Sequence[Cell],
    out: Path,
    reads: Named,
    figures: Sequence[str],
    others: Mapping[str, Path] | None = None,
) -> None:
    """Check that no file of an evaluation overwrites another one, or one that it reads."""
    folder, word = folder_of(out), option("out")
    writes: Named = {
        word: out,
        f"a cell in {word}": [folder.file(cell) for cell in cells],
        **{f"{name} of {word}": out / name for name in (*RESULTS, *figures)},
        **(others or {}),
    }
    check_clashes(reads, writes, folders=[word])


def _completed(
    cells: Sequence[Cell], out: Path, pool: Pool, on_progress: OnProgress
) -> Completed[CellResult]:
    folder = folder_of(out)
    check_writable(out / "results.json")
    folder.check_writable()
    return complete(
        cells,
        folder,
        run_cell,
        pool,
        on_progress,
        describe=_description,
        environments=[cell.policy.environment for cell in cells],
    )


def _written(
    cells: Sequence[Cell],
    completed: Completed[CellResult],
    out: Path,
    write: Callable[[Sequence[dict[str, Any]]], list[Path]],
) -> Evaluation:
    """Write the results to `out`, and the files of `write`."""
    objects = results(cells, completed.results)
    paths = write_results(objects, out) + write(objects)
    return Evaluation(
        tuple(cells),
        tuple(objects),
        completed.run,
        completed.there,
        tuple(completed.failures),
        tuple(paths),
    )


def _known_mitigation(name: str) -> str:
    if name not in MITIGATIONS:
        raise CalibrationError(f"Unknown mitigation {name!r}.", f"Known: {', '.join(MITIGATIONS)}.")
    return name


def _backend(backend: Any) -> Backend:
    """The backend of a name, a file or an object.

    Raises:
        DeviceError: it is an executor, whose draws depend on earlier runs.
    """
    loaded: Backend | Executor = load_backend(backend)
    if isinstance(loaded, Executor):
        raise DeviceError(
            f"A grid cannot be played on an executor, found {loaded!r}.",
            "Every cell opens its own executor: give the device, or a backend from load_backend.",
        )
    return loaded


def _calibration_file(calibration: Name | Calibration) -> CalibrationFile:
    if isinstance(calibration, Calibration):
        return CalibrationFile(f"the calibration of {calibration.backend}", calibration)
    known = load_calibration(calibration)
    return CalibrationFile(str(Path(calibration)), known)


def _description(result: CellResult) -> str:
    values = result.summary
    return f"{values['policy']} on {values['backend']}: {reward_text(values['mean_reward'])}"


def _failure_lines(failure: CellFailure) -> list[str]:
    first, *more = failure.words.splitlines()
    return [f"{failure.name}: {first}", *(f"  {line.strip()}" for line in more)]
