"""`qcompile evaluate`: a grid of policies, backends, shots, mitigations and levels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import (
    BACKEND_HELP,
    echo_json,
    echo_note,
    engine_options,
    env_option,
    import_option,
    json_option,
    once,
)
from qcompile.cli.outputs import Outputs, output_options, report_option
from qcompile.cli.types import Integer, NamePath, OutputPath, Several, Shots
from qcompile.limits import MAX_EPISODES

if TYPE_CHECKING:
    from qcompile.sweep.engine import Engine


class _Mitigation(click.ParamType[str]):
    """The name of a mitigation."""

    name = "name"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from qcompile.deploy.settings import MITIGATIONS

        if value not in MITIGATIONS:
            self.fail(f"{value!r} is not one of {', '.join(MITIGATIONS)}.", param, ctx)
        return str(value)


@click.command("evaluate")
@click.argument("policies", type=NamePath(), nargs=-1, metavar="[POLICY]...")
@click.option(
    "--backend",
    "backends",
    type=Several(NamePath()),
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
    help="none, readout or response, as for `qcompile run`.  [default: none, readout]",
)
@click.option(
    "--calibration",
    "calibrations",
    type=Several(click.Path(dir_okay=False, path_type=Path)),
    multiple=True,
    callback=once,
    metavar="FILE",
    help="Mitigate with this file from `qcompile calibrate` instead of calibrating first, on every "
    "backend of its device.",
)
@click.option(
    "--level",
    "levels",
    type=Several(Integer(0, 2)),
    multiple=True,
    callback=once,
    metavar="0|1|2",
    help="How far to compile, as for `qcompile run`.  [default: 2]",
)
@click.option(
    "--episodes",
    type=Integer(1, MAX_EPISODES),
    default=100,
    show_default=True,
    help="Episodes of each cell.",
)
@click.option(
    "--seed",
    type=Integer(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i.",
)
@click.option(
    "--greedy", is_flag=True, help="Take the most probable action instead of sampling one."
)
@import_option
@env_option
@click.option(
    "--paper",
    is_flag=True,
    help="Repeat the paper's device tests instead of a grid, and write devices.md and devices.png "
    "too.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("evaluation"),
    show_default=True,
    help="Folder for results and figures. Cells already there are not played again.",
)
@click.option(
    "--page",
    type=OutputPath(".md"),
    help="With --paper: Markdown page to write.  [default: devices.md in --out]",
)
@output_options("mean rewards, a panel for each policy", "intervals")
@report_option
@engine_options("cells")
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
    greedy: bool,
    imports: tuple[str, ...],
    env: dict[str, Any],
    paper: bool,
    out: Path,
    page: Path | None,
    engine: Engine,
    address: str | None,
    workers: int | None,
    as_json: bool,
    outputs: Outputs,
) -> None:
    """Play each POLICY (default lunarlander) with every combination of backend, shots, mitigation
    and level.

    Repeat an option to give several values, or separate them with commas. Each combination is a
    cell of the grid. All cells play the same episodes and are compared with the ideal: the same
    policy without noise. Writes results.json, results.csv and a figure for each policy. After
    Ctrl-C the same command resumes with the cells that are missing.
    """
    from qcompile.report.tables import plural, print_grid
    from qcompile.verbs.evaluate import evaluate, evaluate_paper

    sides = {
        "policies": policies,
        "backends": backends,
        "shots": shots,
        "mitigations": mitigations,
        "calibrations": calibrations,
        "levels": levels,
        "imports": imports,
        "env": env,
    }
    named: dict[str, Any] = {name: values for name, values in sides.items() if values}
    if paper and (named or greedy):
        raise click.UsageError(
            "--paper cannot be combined with policies or with options that choose what is played: "
            "the paper's tests fix them all."
        )
    if page is not None and not paper:
        raise click.UsageError("--page needs --paper.")
    shared: dict[str, Any] = {
        "episodes": episodes,
        "seed": seed,
        "out": out,
        "engine": engine,
        "address": address,
        "workers": workers,
        "on_note": echo_note,
    }
    if paper:
        result = evaluate_paper(page=page, **shared)
    else:
        result = evaluate(**named, greedy=greedy, **shared)
    if as_json:
        echo_json(result.to_dict())
    else:
        print_grid(result.cells)
        paths = ", ".join(map(str, result.paths))
        click.echo(
            f"{plural(result.played, 'cell')} played, {result.there} loaded; written: {paths}"
        )
    outputs.save(result, result.check_complete)
