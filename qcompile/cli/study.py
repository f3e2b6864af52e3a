"""`qcompile study`: the paper's training study, as a command."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from qcompile.sweep.engine import Engine
    from qcompile.sweep.study.rows import Cell, Row
    from qcompile.sweep.study.summary import RowSummary


@click.command("study")
@click.argument("name", type=click.Choice(["paper"]), default="paper")
@click.option(
    "--figure",
    "figures",
    multiple=True,
    metavar="NAME",
    help="Only this figure: cartpole, reuse, cartpole-v0, acrobot or lunarlander; repeatable.",
)
@click.option(
    "--row", "only", multiple=True, metavar="NAME", help="Only rows whose name begins with this."
)
@click.option("--seeds", type=click.IntRange(1, 1000), help="Seeds of each row.  [default: 5, 10]")
@click.option(
    "--episodes", type=click.IntRange(1), help="At most so many a training, for a first look."
)
@click.option(
    "--evaluation",
    type=click.IntRange(1, 10_000),
    default=100,
    show_default=True,
    help="Fresh episodes that each final model plays.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("study"),
    show_default=True,
    help="Folder for trainings, CSV and figures; what it holds is not trained again.",
)
@click.option(
    "--page",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Markdown page to write.  [default: reproduction.md in the folder]",
)
@click.option(
    "--engine",
    type=click.Choice(["processes", "dask", "ray"]),
    default="processes",
    show_default=True,
    help="What runs the trainings side by side.",
)
@click.option("--address", help="Address of a running Dask scheduler or Ray cluster.")
@click.option(
    "--workers", type=click.IntRange(1), help="Trainings at a time.  [default: one for each core]"
)
@click.option("--list", "listing", is_flag=True, help="List the rows and what is left, and stop.")
@json_option
def command(
    name: str,
    figures: tuple[str, ...],
    only: tuple[str, ...],
    seeds: int | None,
    episodes: int | None,
    evaluation: int,
    out: Path,
    page: Path | None,
    engine: Engine,
    address: str | None,
    workers: int | None,
    listing: bool,
    as_json: bool,
) -> None:
    """Train every model of the paper with several seeds and write up all that the folder holds.

    Writes results.csv, curves.csv, a picture for each figure and reproduction.md. Ctrl-C keeps
    every finished training; the same command goes on from there.
    """
    from qcompile.errors import StudyError
    from qcompile.output import check_writable
    from qcompile.report.progress import progress_bar
    from qcompile.sweep.engine import run_cells
    from qcompile.sweep.study.cell import EVALUATION_EPISODES, CellResult, write_cell
    from qcompile.sweep.study.paper import rows_of, shortened
    from qcompile.sweep.study.rows import cells
    from qcompile.sweep.study.study import (
        cells_folder,
        check_replaces_nothing,
        missing_cells,
        summaries,
        write_up,
    )

    known = rows_of(())
    if episodes is not None:
        known = [shortened(row, episodes) for row in known]
    names = {row.name for row in rows_of(figures)}
    rows = [row for row in known if row.name in names and row.name.startswith(only or "")]
    if not rows:
        raise StudyError(
            f"No row's name begins with {' or '.join(only)}.", "--list shows their names."
        )
    if page is not None and page.suffix != ".md":
        raise click.BadParameter(f"{page} must end with .md.", param_hint="'--page'")
    page = page or out / "reproduction.md"
    check_writable(page)
    check_writable(cells_folder(out) / "cell.json")
    missing = missing_cells(rows, out, seeds, evaluation)
    count = len(cells(rows, seeds))
    if listing:
        _list(rows, missing, seeds, as_json)
        return
    if episodes is not None or evaluation != EVALUATION_EPISODES:
        check_replaces_nothing(missing, out)
    done = 0
    with progress_bar(f"study {name}", count) as show:
        show(count - len(missing), f"{count - len(missing)} of {count} trainings are there")

        def keep(result: CellResult) -> None:
            nonlocal done
            write_cell(result, cells_folder(out))
            done += 1
            last = result.last_average
            words = f"{result.row}, seed {result.seed}"
            words += "" if last is None else f": {last:.1f}"
            show(count - len(missing) + done, words)

        try:
            run_cells(
                missing,
                keep,
                engine=engine,
                address=address,
                workers=workers,
                evaluation=evaluation,
                on_loss=lambda words: click.echo(words, err=True),
            )
        except KeyboardInterrupt:
            left = len(missing) - done
            raise StudyError(
                f"Interrupted: {left} of {count} trainings are left.",
                f"What is finished is in {out}; the same command goes on from there.",
            ) from None
    found = summaries(known, out)  # what was trained before is written up as well
    paths = write_up(found, out, page)
    if as_json:
        echo_json(
            {
                "study": name,
                "rows": [summary.values() for summary in found],
                "trained": done,
                "files": [str(path) for path in paths],
            }
        )
        return
    _show(found)
    click.echo(f"{done} trainings done, {count - done} were there; written up in {page}")


def _list(rows: Sequence[Row], missing: Sequence[Cell], seeds: int | None, as_json: bool) -> None:
    from qcompile.report.tables import print_table

    values = [
        {
            "row": row.name,
            "environment": row.environment,
            "seeds": row.seeds if seeds is None else seeds,
            "left": sum(cell.row is row for cell in missing),
        }
        for row in rows
    ]
    if as_json:
        echo_json(values)
    else:
        print_table(["row", "environment", "seeds", "left"], [list(v.values()) for v in values])


def _show(found: Sequence[RowSummary]) -> None:
    from qcompile.report.tables import print_table
    from qcompile.sweep.study.summary import spread

    print_table(
        [
            "row",
            "seeds",
            "parameters",
            "target",
            "mean at target",
            "last average",
            "fresh episodes",
        ],
        [
            [
                summary.row.name,
                len(summary.results),
                summary.parameters,
                summary.row.target,
                summary.mean_first or "never",
                spread(summary.final),
                spread(summary.evaluation),
            ]
            for summary in found
        ],
    )
