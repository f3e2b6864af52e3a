"""`qcompile run`: play episodes with a policy on a backend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import (
    backend_option,
    calibration_shots_option,
    echo_json,
    echo_note,
    env_option,
    explicit,
    import_option,
    json_option,
    level_option,
    max_steps_option,
    split_option,
)
from qcompile.cli.outputs import Outputs, output_options, report_option
from qcompile.cli.types import Depth, Integer, NamePath, Shots
from qcompile.limits import MAX_EPISODES

if TYPE_CHECKING:
    from qcompile.verbs.live import Live


@click.command("run")
@click.argument("policy", type=NamePath(), default="lunarlander", metavar="[POLICY]")
@backend_option()
@click.option(
    "--shots",
    type=Shots(),
    default=8192,
    help="Shots of each circuit.  [default: 8192; with --live the cheapest that `qcompile plan` "
    "finds within --max-qpu-seconds]",
)
@click.option(
    "--episodes",
    type=Integer(1, MAX_EPISODES),
    default=20,
    show_default=True,
    help="Number of episodes.",
)
@click.option(
    "--seed",
    type=Integer(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i and draws its own shots and actions.",
)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    help="Errors to correct in the measured `<Z>`. readout: those of the measurement; response: "
    "those of the gates too.  [default: readout on a noisy backend, response if the calibration "
    "has nothing else, none on ideal or with --predistort]",
)
@click.option(
    "--calibration",
    "calibration_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Mitigate with this file from `qcompile calibrate` instead of calibrating first.",
)
@calibration_shots_option
@click.option(
    "--predistort",
    is_flag=True,
    help="Change the angles so that the device itself gives the ideal `<Z>` where it can, instead "
    "of mitigating afterwards.",
)
@click.option(
    "--copies",
    type=Integer(1, MAX_EPISODES),
    help="Copies of the circuits on different qubits of the device, measured at once. Each copy "
    "plays another episode, or shares the shots with --split.  [default: 1; with --live or "
    "--split as many as fit]",
)
@split_option
@click.option(
    "--speculate",
    type=Depth(),
    default=1,
    help="Predict actions, to measure up to D decisions of each episode in one job and need fewer "
    "jobs. Decisions after a wrong prediction are measured again. auto: the D that saves most. "
    " [default: 1; with --live auto]",
)
@max_steps_option
@click.option(
    "--greedy", is_flag=True, help="Take the most probable action instead of sampling one."
)
@import_option
@env_option
@click.option(
    "--video",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Film the first episode, with the `<Z>` of every circuit and the probabilities of the "
    "actions; .mp4, .gif or .webm, overwritten.",
)
@output_options("the reward of each episode", "rewards")
@report_option
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
    outputs: Outputs,
) -> None:
    """Play episodes with POLICY: a shipped policy (default lunarlander), or a policy file.

    The same seed gives the same result. Ctrl-C ends the run and reports the episodes finished so
    far. With --live the circuits run on the IBM machine named by --backend, and every step is
    recorded: after Ctrl-C, `qcompile resume` continues the run.
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
        **explicit(
            shots=shots, calibration_shots=calibration_shots, split=split, speculate=speculate
        ),
        on_note=echo_note,
    )
    if as_json:
        echo_json(result.to_dict())
    else:
        print_run(result.to_dict())
    outputs.save(result, result.check_complete, is_empty=not result.episodes)
