"""`qcompile validate`: whether a calibration's twin shows what its machine does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import (
    Share,
    echo_json,
    echo_note,
    env_option,
    import_option,
    json_option,
)
from qcompile.limits import MAX_SHOTS

if TYPE_CHECKING:
    from qcompile.verbs.live import Live


@click.command("validate")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--policy", default="lunarlander", show_default=True, help="Whose circuits are compared."
)
@click.option(
    "--observations",
    type=click.IntRange(1, 1000),
    help="How many, from episodes that the policy plays on the twin.  [default: by --power]",
)
@click.option(
    "--shots",
    type=click.IntRange(1, MAX_SHOTS),
    help="Shots of each circuit.  [default: by --power]",
)
@click.option(
    "--power",
    type=Share(open_end=True),
    help="How often a moved qubit is to be found; chooses observations and shots.  [default: 0.9]",
)
@click.option(
    "--effect",
    type=Share(),
    default=0.05,
    show_default=True,
    help="How far the p01 of a moved qubit is raised.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Draws the episodes."
)
@import_option
@env_option
@click.option(
    "--backend",
    metavar="NAME",
    help="Without --live: compare with this noise model, calibration or qiskit:NAME.  [default: "
    "the device of the file]",
)
@live_options
@json_option
def command(
    file: Path,
    policy: str,
    observations: int | None,
    shots: int | None,
    power: float | None,
    effect: float,
    seed: int,
    imports: tuple[str, ...],
    env: dict[str, Any],
    backend: str | None,
    live: Live | None,
    as_json: bool,
) -> None:
    """Run a policy's circuits and compare their counts with the twin of the calibration FILE.

    Exit 1 where a qubit contradicts its curve (chi-square, once in a thousand times by chance). It
    takes the fewest executions that find a p01 of any one qubit raised by --effect with --power.
    With --live on the machine that FILE was measured on, for a few seconds.
    """
    from qcompile.report.live import charged, print_validation
    from qcompile.verbs.validate import validate

    validation = validate(
        file,
        policy=policy,
        observations=observations,
        shots=shots,
        power=power,
        effect=effect,
        seed=seed,
        imports=imports,
        env=env,
        backend=backend,
        live=live,
        on_note=echo_note,
    )
    if as_json:
        echo_json(validation.to_dict())
    else:
        print_validation(validation.to_dict())
        if live is not None:
            click.echo(charged(validation.to_dict()))
    validation.check_passed()
