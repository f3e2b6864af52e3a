"""`qcompile run`: play episodes with a policy on a backend."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import click

from qcompile.cli.options import Shots, backend_option, echo_json, json_option, level_option
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
    type=click.Choice(["none", "readout"]),
    help="Undo readout errors.  [default: readout on a noisy backend, none on ideal]",
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
    greedy: bool,
    video: Path | None,
    as_json: bool,
) -> None:
    """Play episodes with POLICY (default lunarlander; a name of trained/ or a file).

    A run repeats exactly with the same seed. Ctrl-C ends it and reports the finished episodes.
    """
    from qcompile.device import load_device
    from qcompile.errors import QcompileError
    from qcompile.policy import load_policy
    from qcompile.report.film import SUFFIXES, Film
    from qcompile.report.progress import progress_bar
    from qcompile.report.tables import print_run
    from qcompile.rl.evaluate import Deployment, play
    from qcompile.rl.lockstep import Episode

    if video is not None and video.suffix not in SUFFIXES:
        raise click.BadParameter(f"{video} must end with .mp4 or .gif.", param_hint="'--video'")
    device = load_device(backend)
    loaded = load_policy(policy)
    chosen = mitigation or ("none" if device.is_ideal else "readout")
    with (
        nullcontext() if video is None else Film(video) as film,
        progress_bar(f"{loaded.name} on {device.name}", episodes) as show,
    ):
        show(0, "compiling" if chosen == "none" else "calibrating the readout")
        deployment = Deployment(
            loaded, device, shots=shots, level=level, mitigation=chosen, greedy=greedy, seed=seed
        )
        show(0, "")
        rewards: list[float] = []

        def count(episode: Episode) -> None:
            rewards.append(episode.reward)
            show(len(rewards), f"mean reward {sum(rewards) / len(rewards):.1f}")

        result = play(deployment, episodes, on_episode=count, on_frame=film.add if film else None)
    summary = result.summary()
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
