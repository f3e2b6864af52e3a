"""`qcompile study`: rows trained with several seeds and written up, as a command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import (
    MarkdownPath,
    echo_json,
    echo_note,
    engine_options,
    env_option,
    import_option,
    json_option,
)
from qcompile.cli.outputs import Outputs, output_options

if TYPE_CHECKING:
    from qcompile.sweep.engine import Engine


@click.command("study")
@click.argument("name", default="paper", metavar="[paper|FILE.toml]")
@click.option(
    "--figure",
    "figures",
    multiple=True,
    metavar="NAME",
    help="Only this figure, of paper: cartpole, reuse, cartpole-v0, acrobot or lunarlander; "
    "repeatable.",
)
@click.option(
    "--row", "rows", multiple=True, metavar="NAME", help="Only rows whose name begins with this."
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    help="Seeds of each row.  [default: the study's; paper: 5, 10]",
)
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
    help="Folder for trainings, CSV and figures; what it holds is not trained again. "
    " [default: study, or the name of the file]",
)
@click.option(
    "--page",
    type=MarkdownPath(),
    help="Markdown page to write.  [default: reproduction.md in the folder]",
)
@output_options("the learning curves, a panel for each figure")
@import_option
@env_option
@engine_options("trainings")
@click.option("--list", "listing", is_flag=True, help="List the rows and what is left, and stop.")
@json_option
def command(
    engine: Engine,
    address: str | None,
    workers: int | None,
    listing: bool,
    as_json: bool,
    outputs: Outputs,
    **choice: Any,
) -> None:
    """Train every row of a study with several seeds and write up all that the folder holds.

    A study is `paper`, the paper's, or a TOML file with rows of your own. Writes results.csv,
    curves.csv, a picture for each figure and reproduction.md. Ctrl-C keeps every finished training;
    the same command resumes from there.
    """
    from qcompile.report.tables import print_table
    from qcompile.sweep.study import StudyRequest
    from qcompile.verbs.study import study

    if listing:
        members = StudyRequest(**choice).left()
        if as_json:
            echo_json(members)
        else:
            columns = ["row", "environment", "seeds", "left"]
            print_table(columns, [[*row.values()] for row in members])
        return
    result = study(**choice, engine=engine, address=address, workers=workers, on_note=echo_note)
    if as_json:
        echo_json(result.to_dict())
    else:
        table = result.table()
        print_table(table.header, table.words, right=(1, 2, 3))
        click.echo(
            f"{result.trained} trainings done, {result.there} were there; "
            f"written up in {result.page}"
        )
    outputs.save(result, quiet=as_json)
