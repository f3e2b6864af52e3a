"""`qcompile run`: play episodes with a policy on a backend."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import click

from qcompile.cli.options import (
    Shots,
    backend_option,
    echo_json,
    json_option,
    level_option,
    report_age,
)
from qcompile.limits import MAX_EPISODES


@click.command("run")
@click.argument("policy", default="lunarlander", metavar="[POLICY]")
@backend_option()
@click.option(
    "--shots", type=Shots(), default=8192, show_default=True, help="Shots of each circuit."
)
@click.option("--episodes", type=click.IntRange(1, MAX_EPISODES), default=20, show_default=True)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i. All episodes draw shots and actions from "
    "one stream, so a run repeats exactly with the same --episodes.",
)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    help="Undo readout errors, or those of the gates as well.  [default: readout on a noisy "
    "backend, none on ideal or with --predistort]",
)
@click.option(
    "--calibration",
    "calibration_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Mitigate with this file of `qcompile calibrate` instead of measuring first.",
)
@click.option(
    "--predistort",
    is_flag=True,
    help="Bend the angles so that the device shows the ideal <Z>, where it can.",
)
@click.option(
    "--copies",
    type=click.IntRange(1, MAX_EPISODES),
    default=1,
    show_default=True,
    help="Episodes that share an execution, side by side on the device.",
)
@click.option("--greedy", is_flag=True, help="Take the most probable action; default: sample.")
@click.option(
    "--video",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Film the first episode; .mp4 or .gif, overwritten.",
)
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
    copies: int,
    greedy: bool,
    video: Path | None,
    as_json: bool,
) -> None:
    """Play episodes with POLICY (default lunarlander; a name of trained/ or a file).

    A run repeats exactly with the same seed. Ctrl-C ends it and reports the finished episodes.
    """
    from qcompile.calibration import load_calibration
    from qcompile.device import IDEAL_NAME
    from qcompile.errors import QcompileError
    from qcompile.policy import load_policy
    from qcompile.report.film import SUFFIXES, Film
    from qcompile.report.progress import progress_bar
    from qcompile.report.tables import print_run
    from qcompile.rl.evaluate import Deployment, play
    from qcompile.rl.lockstep import Episode

    if video is not None and video.suffix not in SUFFIXES:
        raise click.BadParameter(f"{video} must end with .mp4 or .gif.", param_hint="'--video'")
    chosen = mitigation or ("none" if predistort or backend == IDEAL_NAME else "readout")
    if predistort and chosen != "none":
        raise click.UsageError(
            f"--predistort and --mitigation {chosen} exclude each other: with bent angles the "
            "device shows the ideal <Z>."
        )
    if calibration_file is not None and chosen == "none" and not predistort:
        raise click.UsageError(
            "--calibration needs --mitigation readout or response, or "
            "--predistort: nothing else reads it."
        )
    loaded = load_policy(policy)
    calibration = None
    if calibration_file is not None:
        calibration = load_calibration(calibration_file)
        report_age(calibration_file, calibration)
    with (
        nullcontext() if video is None else Film(video) as film,
        progress_bar(f"{loaded.name} on {backend}", episodes) as show,
    ):
        measures = calibration is None and (chosen != "none" or predistort)
        show(0, "calibrating" if measures else "compiling")
        deployment = Deployment(
            loaded,
            backend,
            shots=shots,
            level=level,
            mitigation=chosen,
            calibration=calibration,
            predistort=predistort,
            greedy=greedy,
            seed=seed,
            copies=copies,
        )
        show(0, "")
        rewards: list[float] = []

        def count(episode: Episode) -> None:
            rewards.append(episode.reward)
            show(len(rewards), f"mean reward {sum(rewards) / len(rewards):.1f}")

        result = play(deployment, episodes, on_episode=count, on_frame=film.add if film else None)
    file = None if calibration_file is None else str(calibration_file)
    summary = result.summary(file)
    if as_json:
        echo_json(summary)
    else:
        print_run(summary)
    if film is not None and film.frames:
        click.echo(f"film of the first episode in {video}", err=True)
    if result.interrupted:
        raise QcompileError(
            f"Interrupted: {len(result.episodes)} of {episodes} episodes were finished.",
            "These are the shortest ones, so their mean is no estimate of the policy's score.",
            "Fewer --episodes end sooner.",
        )
