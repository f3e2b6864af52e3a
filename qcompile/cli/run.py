"""`qcompile run`: play episodes with a policy on a backend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import (
    Depth,
    Shots,
    backend_option,
    calibration_shots_option,
    echo_json,
    echo_note,
    env_option,
    import_option,
    json_option,
    level_option,
    max_steps_option,
    said,
    split_option,
)
from qcompile.limits import MAX_EPISODES

if TYPE_CHECKING:
    from qcompile.verbs.live import Live


@click.command("run")
@click.argument("policy", default="lunarlander", metavar="[POLICY]")
@backend_option()
@click.option(
    "--shots",
    type=Shots(),
    default=8192,
    help="Shots of each circuit.  [default: 8192; with --live as planned, within the limit]",
)
@click.option("--episodes", type=click.IntRange(1, MAX_EPISODES), default=20, show_default=True)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i and draws shots and actions from streams "
    "of its own.",
)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    help="Undo readout errors, or those of the gates as well.  [default: readout on a noisy "
    "backend, response where only that is calibrated, none on ideal or with --predistort]",
)
@click.option(
    "--calibration",
    "calibration_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Mitigate with this file of `qcompile calibrate` instead of measuring first.",
)
@calibration_shots_option
@click.option(
    "--predistort",
    is_flag=True,
    help="Change the angles so that the device shows the ideal `<Z>`, where it can.",
)
@click.option(
    "--copies",
    type=click.IntRange(1, MAX_EPISODES),
    help="Copies of the circuits side by side on the device: one for each episode, or --split. "
    " [default: 1; with --live or --split as many as fit]",
)
@split_option
@click.option(
    "--speculate",
    type=Depth(),
    default=1,
    help="Measure up to D decisions of each episode in one job, along predicted actions: fewer "
    "jobs. What lies beyond a wrong prediction is measured again. auto: the D that saves most. "
    " [default: 1; with --live auto]",
)
@max_steps_option
@click.option("--greedy", is_flag=True, help="Take the most probable action; default: sample.")
@import_option
@env_option
@click.option(
    "--video",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Film the first episode, with the `<Z>` of every circuit and the probabilities of the "
    "actions; .mp4, .gif or .webm, overwritten.",
)
@live_options
@json_option
def command(
    policy: str,
    backend: str,
    shots: int | None,
    episodes: int,
    seed: int,
    level: int,
    mitigation: str | None,
    calibration_file: Path | None,
    predistort: bool,
    calibration_shots: int | Literal["auto"],
    copies: int | None,
    split: bool,
    speculate: int | Literal["auto"],
    max_steps: int | None,
    greedy: bool,
    imports: tuple[str, ...],
    env: dict[str, Any],
    video: Path | None,
    as_json: bool,
    live: Live | None,
) -> None:
    """Play episodes with POLICY (default lunarlander; a name of trained/ or a file).

    A run repeats exactly with the same seed. Ctrl-C ends it and reports the finished episodes.
    With --live it is played on IBM's machine of that name, recorded step by step; Ctrl-C stops it
    and `qcompile resume` resumes it.
    """
    from qcompile.report.summary import print_run
    from qcompile.verbs.run import run

    result = run(
        policy,
        backend,
        episodes=episodes,
        seed=seed,
        level=level,
        mitigation=mitigation,
        calibration=calibration_file,
        predistort=predistort,
        copies=copies,
        max_steps=max_steps,
        greedy=greedy,
        imports=imports,
        env=env,
        video=video,
        live=live,
        **said(shots=shots, calibration_shots=calibration_shots, split=split, speculate=speculate),
        on_note=echo_note,
    )
    if as_json:
        echo_json(result.to_dict())
    else:
        print_run(result.to_dict())
    result.check_complete()
