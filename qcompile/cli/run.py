"""`qcompile run`: play episodes with a policy on a backend."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from qcompile.cli.live_options import Live, live_options
from qcompile.cli.options import (
    Shots,
    backend_option,
    echo_json,
    json_option,
    level_option,
    max_steps_option,
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
    "backend, response where only that is calibrated, none on ideal or with --predistort]",
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
    help="Bend the angles so that the device shows the ideal `<Z>`, where it can.",
)
@click.option(
    "--copies",
    type=click.IntRange(1, MAX_EPISODES),
    help="Episodes that share an execution, side by side on the device.  [default: 1; with --live "
    "as many as fit]",
)
@max_steps_option
@click.option("--greedy", is_flag=True, help="Take the most probable action; default: sample.")
@click.option(
    "--video",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Film the first episode; .mp4 or .gif, overwritten.",
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
    copies: int | None,
    max_steps: int | None,
    greedy: bool,
    video: Path | None,
    as_json: bool,
    live: Live | None,
) -> None:
    """Play episodes with POLICY (default lunarlander; a name of trained/ or a file).

    A run repeats exactly with the same seed. Ctrl-C ends it and reports the finished episodes.
    With --live it is played on IBM's machine of that name, recorded step by step; Ctrl-C stops it
    and `qcompile resume` goes on.
    """
    from qcompile.calibration import load_calibration
    from qcompile.deploy.deployment import Deployment
    from qcompile.deploy.lockstep import Episode
    from qcompile.deploy.play import play
    from qcompile.device import IDEAL_NAME
    from qcompile.errors import QcompileError
    from qcompile.execution import load_backend
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values
    from qcompile.report.film import SUFFIXES, Film
    from qcompile.report.progress import progress_bar
    from qcompile.report.tables import print_run

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
    if copies is not None and copies > episodes:
        raise click.UsageError(
            f"--copies {copies} are more than the --episodes {episodes} there are to share an "
            "execution."
        )
    if live is not None and (video is not None or shots is None):
        wrong = "--video" if video is not None else "--shots exact"
        raise click.UsageError(f"{wrong} and --live exclude each other.")
    loaded = load_policy(policy)
    calibration = None
    if calibration_file is not None:
        calibration = load_calibration(calibration_file)
        report_age(calibration_file, calibration)
    opened = backend if live is not None else load_backend(backend)
    known = calibration if isinstance(opened, str) else calibration or opened.calibration
    if mitigation is None and chosen == "readout" and known is not None:
        chosen = known.mitigation
    file = None if calibration_file is None else str(calibration_file)
    settings: dict[str, Any] = {
        "shots": shots,
        "level": level,
        "mitigation": chosen,
        "calibration": calibration,
        "predistort": predistort,
        "greedy": greedy,
        "seed": seed,
    }
    if live is not None:
        settings |= {"backend": backend, "policy": policy_values(loaded), "episodes": episodes}
        settings |= {"calibration_file": file, "max_steps": max_steps}
        _run_live(live, as_json, copies, settings)
        return
    with (
        nullcontext() if video is None else Film(video) as film,
        progress_bar(f"{loaded.name} on {backend}", episodes) as show,
    ):
        measures = calibration is None and (chosen != "none" or predistort)
        show(0, "calibrating" if measures else "compiling")
        deployment = Deployment(loaded, opened, copies=copies or 1, **settings)
        show(0, "")
        rewards: list[float] = []

        def count(episode: Episode) -> None:
            rewards.append(episode.reward)
            show(len(rewards), f"mean reward {sum(rewards) / len(rewards):.1f}")

        result = play(
            deployment,
            episodes,
            max_steps=max_steps,
            on_episode=count,
            on_frame=film.add if film else None,
        )
    summary = result.summary(file)
    if as_json:
        echo_json(summary)
    else:
        print_run(summary)
    if film is not None:
        words = f"film of the first episode in {video}"
        click.echo(words if film.frames else "no step was played: there is no film", err=True)
    if result.interrupted:
        raise QcompileError(
            f"Interrupted: {len(result.episodes)} of {episodes} episodes were finished.",
            "These are the shortest ones, so their mean is no estimate of the policy's score.",
            "Fewer --episodes end sooner.",
        )


def _run_live(live: Live, as_json: bool, copies: int | None, settings: dict[str, Any]) -> None:
    """Plan the run on the noise model of the backend of now, have it confirmed, and play it."""
    from qcompile.cli.live_options import spend
    from qcompile.live.connection import Connection
    from qcompile.live.plan import copies_that_fit, forecast
    from qcompile.live.play import RunTask
    from qcompile.mitigation.misfit import misfit_words
    from qcompile.report.tables import print_run

    connection = Connection(settings["backend"], live.account, live.instance)
    task = RunTask.model_validate({**settings, **live.where, "device": connection.device()})
    task = task.model_copy(update={"copies": copies or copies_that_fit(task)})
    planned = forecast(task)
    if task.calibration is not None:
        for words in misfit_words(planned.deployment.misfits):
            click.echo(f"{task.calibration_file}: {words}", err=True)
    load = planned.total_load
    summary = spend(task, load, live, connection)
    if as_json:
        echo_json(summary)
    else:
        print_run(summary)
