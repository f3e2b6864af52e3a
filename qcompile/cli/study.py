"""`qcompile study`: the paper's training study, as a command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import (
    MarkdownPath,
    echo_json,
    echo_note,
    engine_options,
    import_option,
    json_option,
)

if TYPE_CHECKING:
    from qcompile.sweep.engine import Engine


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
    "--row", "rows", multiple=True, metavar="NAME", help="Only rows whose name begins with this."
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
    type=MarkdownPath(),
    help="Markdown page to write.  [default: reproduction.md in the folder]",
)
@import_option
@engine_options("trainings")
@click.option("--list", "listing", is_flag=True, help="List the rows and what is left, and stop.")
@json_option
def command(
    name: str,
    figures: tuple[str, ...],
    rows: tuple[str, ...],
    seeds: int | None,
    episodes: int | None,
    evaluation: int,
    out: Path,
    page: Path | None,
    imports: tuple[str, ...],
    engine: Engine,
    address: str | None,
    workers: int | None,
    listing: bool,
    as_json: bool,
) -> None:
    """Train every model of the paper with several seeds and write up all that the folder holds.

    Writes results.csv, curves.csv, a picture for each figure and reproduction.md. Ctrl-C keeps
    every finished training; the same command resumes from there.
    """
    from qcompile.report.tables import print_table
    from qcompile.verbs.study import study, study_rows

    choice: dict[str, Any] = {
        "figures": figures,
        "rows": rows,
        "seeds": seeds,
        "episodes": episodes,
        "evaluation": evaluation,
        "out": out,
    }
    if listing:
        members = study_rows(name, **choice)
        if as_json:
            echo_json(members)
        else:
            columns = ["row", "environment", "seeds", "left"]
            print_table(columns, [[*row.values()] for row in members])
        return
    result = study(
        name,
        **choice,
        page=page,
        imports=imports,
        engine=engine,
        address=address,
        workers=workers,
        on_note=echo_note,
    )
    if as_json:
        echo_json(result.to_dict())
        return
    print_table(*result.table, right=(1, 2, 3))
    click.echo(
        f"{result.trained} trainings done, {result.there} were there; written up in {result.page}"
    )
