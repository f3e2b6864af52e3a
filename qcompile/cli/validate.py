"""`qcompile validate`: test a calibration against fresh counts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import echo_json, echo_note, env_option, import_option, json_option
from qcompile.cli.types import Integer, Share
from qcompile.limits import MAX_SHOTS

if TYPE_CHECKING:
    from qcompile.verbs.live import Live


@click.command("validate")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--policy", default="lunarlander", show_default=True, help="Policy whose circuits are run."
)
@click.option(
    "--observations",
    type=Integer(1, 1000),
    help="Number of observations to run, taken from simulated episodes.  [default: what --power "
    "needs]",
)
@click.option(
    "--shots",
    type=Integer(1, MAX_SHOTS),
    help="Shots of each circuit.  [default: what --power needs]",
)
@click.option(
    "--power",
    type=Share(open_end=True),
    help="Probability of detecting a change of --effect on any one qubit; chooses observations and "
    "shots.  [default: 0.9]",
)
@click.option(
    "--effect",
    type=Share(),
    default=0.05,
    show_default=True,
    help="Increase of a qubit's p01, its chance of reading 1 as 0, to detect.",
)
@click.option(
    "--seed", type=Integer(0), default=0, show_default=True, help="Seed of the episodes and shots."
)
@import_option
@env_option
@click.option(
    "--backend",
    metavar="NAME",
    help="Without --live: run the circuits on this backend.  [default: the noise model of FILE's "
    "device]",
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
    """Run a policy's circuits and compare the counts with what the calibration FILE predicts.

    Exit code 1 means that a qubit no longer follows its response curve, by a chi-square test that
    fails once in a thousand times by chance. With --live the circuits run on the machine that FILE
    was measured on, for a few QPU seconds.
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
