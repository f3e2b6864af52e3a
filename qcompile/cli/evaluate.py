"""`qcompile evaluate`: a grid of policies, backends, shots, mitigations and levels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import (
    BACKEND_HELP,
    Several,
    Shots,
    echo_json,
    json_option,
    once,
    report_age,
)
from qcompile.limits import MAX_EPISODES

if TYPE_CHECKING:
    from qcompile.sweep.evaluation.cell import CellFailure, CellResult
    from qcompile.sweep.evaluation.grid import Cell


class _Mitigation(click.ParamType[str]):
    """The name of a mitigation."""

    name = "name"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from qcompile.deploy.measurement import MITIGATIONS

        if value not in MITIGATIONS:
            self.fail(f"{value!r} is not one of {', '.join(MITIGATIONS)}.", param, ctx)
        return str(value)


@click.command("evaluate")
@click.argument("policies", nargs=-1, metavar="[POLICY]...")
@click.option(
    "--backend",
    "backends",
    type=Several(click.STRING),
    multiple=True,
    callback=once,
    metavar="NAME",
    help=f"{BACKEND_HELP}  [default: ibm_lima]",
)
@click.option(
    "--shots",
    type=Several(Shots()),
    multiple=True,
    callback=once,
    help="Shots of each circuit.  [default: 1024, 8192]",
)
@click.option(
    "--mitigation",
    "mitigations",
    type=Several(_Mitigation()),
    multiple=True,
    callback=once,
    help="none, readout, ...: as for `qcompile run`.  [default: none, readout]",
)
@click.option(
    "--calibration",
    "calibrations",
    type=Several(click.Path(dir_okay=False, path_type=Path)),
    multiple=True,
    callback=once,
    metavar="FILE",
    help="Mitigate with this file of `qcompile calibrate` instead of measuring first, on every "
    "backend of its device.",
)
@click.option(
    "--level",
    "levels",
    type=Several(click.IntRange(0, 2)),
    multiple=True,
    callback=once,
    metavar="0|1|2",
    help="What compilation keeps: as for `qcompile run`.  [default: 2]",
)
@click.option(
    "--episodes",
    type=click.IntRange(1, MAX_EPISODES),
    default=100,
    show_default=True,
    help="Episodes of each cell, the same resets in all.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i.",
)
@click.option(
    "--paper",
    is_flag=True,
    help="The paper's device tests instead of a grid; writes devices.md and devices.png as well.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("evaluation"),
    show_default=True,
    help="Folder for cells, results and pictures; cells that it holds are not played again.",
)
@click.option(
    "--page",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Markdown page of --paper.  [default: devices.md in the folder]",
)
@click.option(
    "--workers", type=click.IntRange(1), help="Cells at a time.  [default: one for each core]"
)
@json_option
def command(
    policies: tuple[str, ...],
    backends: tuple[str, ...],
    shots: tuple[int | None, ...],
    mitigations: tuple[str, ...],
    calibrations: tuple[Path, ...],
    levels: tuple[int, ...],
    episodes: int,
    seed: int,
    paper: bool,
    out: Path,
    page: Path | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Play every combination of POLICY (default lunarlander), backend, shots, mitigation and level.

    Options can be repeated, or take several values with commas between them. Every cell plays the
    same episodes and is compared with its policy on ideal with exact expectations. Writes
    results.json, results.csv and a picture for each policy. Ctrl-C keeps every finished cell; the
    same command goes on from there.
    """
    from qcompile.errors import StudyError
    from qcompile.output import check_writable
    from qcompile.report.progress import progress_bar
    from qcompile.report.tables import print_grid
    from qcompile.sweep.engine import run_all
    from qcompile.sweep.evaluation.cell import CellFailure, run_cell, write_cell
    from qcompile.sweep.evaluation.page import write_devices
    from qcompile.sweep.evaluation.paper import paper_cells
    from qcompile.sweep.evaluation.summary import results
    from qcompile.sweep.evaluation.write_up import (
        cells_folder,
        kept_results,
        write_figures,
        write_results,
    )

    if paper and (policies or backends or shots or mitigations or calibrations or levels):
        raise click.UsageError("--paper has its own policies, backends, shots and mitigations.")
    if page is not None and not paper:
        raise click.UsageError("--page is the page of --paper.")
    if page is not None and page.suffix != ".md":
        raise click.BadParameter(f"{page} must end with .md.", param_hint="'--page'")
    if paper:
        cells = paper_cells(episodes, seed)
    else:
        cells = _cells(
            policies or ("lunarlander",),
            backends or ("ibm_lima",),
            shots or (1024, 8192),
            mitigations or ("none", "readout"),
            calibrations,
            levels or (2,),
            episodes,
            seed,
        )
    page = page or out / "devices.md"
    for path in (out / "results.json", cells_folder(out) / "cell.json", page if paper else None):
        if path is not None:
            check_writable(path)
    found = kept_results(cells, out)
    there = len(found)
    failures: list[CellFailure] = []
    with progress_bar("evaluate", len(cells)) as show:
        show(there, f"{there} of {len(cells)} cells are there" if there else "")

        def keep(result: CellResult | CellFailure) -> None:
            if isinstance(result, CellFailure):
                failures.append(result)
                show(len(found) + len(failures), f"{result.name} failed")
                return
            write_cell(result, cells_folder(out))
            found[result.name] = result
            values = result.summary
            words = f"{values['policy']} on {values['backend']}: {values['mean_reward']:.1f}"
            show(len(found) + len(failures), words)

        try:
            run_all(
                [cell for cell in cells if cell.name not in found],
                run_cell,
                keep,
                workers=workers,
                on_loss=lambda words: click.echo(words, err=True),
            )
        except KeyboardInterrupt:
            raise StudyError(
                f"Interrupted: {len(found)} of {len(cells)} cells are finished.",
                f"What is finished is in {out}; the same command goes on from there.",
            ) from None
    objects = results(cells, found)
    paths = write_results(objects, out)
    if not paper:
        paths += write_figures(objects, out)
    elif not failures:
        paths += write_devices(cells, found, out, page)
    if as_json:
        echo_json({"results": objects})
    else:
        print_grid(objects)
        written = ", ".join(map(str, paths))
        click.echo(f"{len(found) - there} cells played, {there} were there; written: {written}")
    if failures:
        raise StudyError(
            f"{len(failures)} of {len(cells)} cells could not be played.",
            *chain.from_iterable(_lines(failure) for failure in failures),
        )


def _cells(
    policies: Sequence[str],
    backends: Sequence[str],
    shots: Sequence[int | None],
    mitigations: Sequence[str],
    calibrations: Sequence[Path],
    levels: Sequence[int],
    episodes: int,
    seed: int,
) -> list[Cell]:
    """The grid, after all that it names has been found, and what can be checked has been."""
    from qcompile.calibration import load_calibration
    from qcompile.deploy.environments import check_fit, make_environments
    from qcompile.execution import load_backend
    from qcompile.policy import load_policy
    from qcompile.sweep.evaluation.calibrations import CalibrationFile
    from qcompile.sweep.evaluation.cell import check_calibrations
    from qcompile.sweep.evaluation.grid import grid, left_out, told_apart

    loaded = told_apart(policies, [load_policy(name) for name in policies])
    opened = [load_backend(name) for name in backends]
    files = [CalibrationFile(str(path), load_calibration(path)) for path in calibrations]
    settings = (shots, mitigations, levels)
    cells = grid(loaded, opened, *settings, calibrations=files, episodes=episodes, seed=seed)
    for policy in loaded:
        (environment,) = make_environments(
            policy.environment, 1, arguments=policy.environment_kwargs
        )
        try:
            check_fit(policy, environment)
        finally:
            environment.close()
    check_calibrations(cells)
    for path, file in zip(calibrations, files, strict=True):
        report_age(path, file.calibration)
    for why in dict.fromkeys(left_out(opened, *settings).values()):
        click.echo(f"left out: {why}.", err=True)
    return cells


def _lines(failure: CellFailure) -> list[str]:
    first, *more = failure.words.splitlines()
    return [f"{failure.name}: {first}", *(f"  {line.strip()}" for line in more)]
