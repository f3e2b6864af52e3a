"""`qcompile study`: train many policies with several seeds, and write up the results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import (
    check_only,
    echo_json,
    echo_note,
    engine_options,
    env_option,
    import_option,
    json_option,
)
from qcompile.cli.outputs import Outputs, output_options, report_option
from qcompile.cli.types import Integer, NamePath, OutputPath

_LISTING = {
    *("name", "figures", "rows", "seeds", "episodes", "evaluation"),
    *("out", "imports", "env", "listing", "as_json"),
}
"""The options that can be used with --list."""

if TYPE_CHECKING:
    from qcompile.sweep.engine import Engine


@click.command("study")
@click.argument("name", type=NamePath(), default="paper", metavar="[paper|FILE.toml]")
@click.option(
    "--figure",
    "figures",
    multiple=True,
    metavar="NAME",
    help="Only the rows of this figure; repeatable. Those of `paper` are cartpole, reuse, "
    "cartpole-v0, acrobot and lunarlander.",
)
@click.option(
    "--row",
    "rows",
    multiple=True,
    metavar="NAME",
    help="Only rows whose names begin with NAME; repeatable.",
)
@click.option(
    "--seeds",
    type=Integer(1, 1000),
    help="Number of seeds of each row.  [default: the study's; for paper 5 or 10]",
)
@click.option(
    "--episodes",
    type=Integer(1),
    metavar="N",
    help="Stop each training after N episodes, for a first look.",
)
@click.option(
    "--evaluation",
    type=Integer(1, 10_000),
    default=100,
    show_default=True,
    help="Episodes that each trained model plays at the end.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for trainings, CSV files and figures. Trainings already there are not repeated. "
    " [default: study, or the name of the file]",
)
@click.option(
    "--page",
    type=OutputPath(".md"),
    help="Markdown page to write.  [default: reproduction.md in --out]",
)
@output_options("the learning curves, a panel for each figure", "curves")
@report_option
@import_option
@env_option
@engine_options("trainings")
@click.option(
    "--list", "listing", is_flag=True, help="Only list the rows and the trainings still to do."
)
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
    """Train every row of a study with several seeds, and write up the results.

    A study is `paper`, which repeats the paper's, or a TOML file of your own. A row is a model
    trained in an environment with certain settings. Writes results.csv, curves.csv, the learning
    curves of each figure, and the page reproduction.md. After Ctrl-C the same command resumes with
    the trainings that are missing.
    """
    from qcompile.report.tables import plural, print_table
    from qcompile.sweep.study import StudyRequest
    from qcompile.verbs.study import study

    if listing:
        check_only(_LISTING, "--list", "nothing is trained")
        members = StudyRequest(**choice).left()
        if as_json:
            echo_json(members)
        else:
            columns = ["row", "environment", "seeds", "to do"]
            print_table(columns, [[*row.values()] for row in members])
        return
    result = study(**choice, engine=engine, address=address, workers=workers, on_note=echo_note)
    if as_json:
        echo_json(result.to_dict())
    else:
        table = result.table()
        print_table(table.header, table.words, right=(1, 2, 3))
        click.echo(
            f"{plural(result.trained, 'training')} done, {result.there} loaded; "
            f"results written to {result.page}"
        )
    outputs.save(result)
