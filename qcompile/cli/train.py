"""`qcompile train`: make a policy."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from qcompile.cli.options import echo_json, json_option


@click.command("train")
@click.argument("environment")
@click.option("--model", type=click.Choice(["svqc"]), default="svqc", show_default=True)
@click.option(
    "--preset",
    type=click.Choice(["paper", "tuned"]),
    default="tuned",
    show_default=True,
    help="paper: arXiv 2203.14348 as it stands; tuned: ours.",
)
@click.option(
    "--layout",
    type=click.Choice(["parallel", "serial", "single"]),
    default="parallel",
    show_default=True,
    help="A circuit per feature and copy, re-uploading, or one circuit for three features.",
)
@click.option("--reuse", type=click.IntRange(1, 1000), help="Copies of each output in training.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option(
    "--episodes",
    type=click.IntRange(1),
    help="Stop after so many episodes.  [default: the preset's]",
)
@click.option(
    "--steps",
    type=click.IntRange(1),
    help="Stop after so many environment steps.  [default: the preset's]",
)
@click.option(
    "--log",
    type=click.Path(dir_okay=False, path_type=Path),
    help="CSV, a row for each episode: its number, all steps taken by its end, its reward.",
)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="Policy file to write, .pt or .json; overwritten.",
)
@json_option
def command(
    environment: str,
    model: str,
    preset: str,
    layout: str,
    reuse: int | None,
    seed: int,
    episodes: int | None,
    steps: int | None,
    log: Path | None,
    out: Path,
    as_json: bool,
) -> None:
    """Train a policy in ENVIRONMENT, such as CartPole-v1, with PPO.

    Ctrl-C ends the training and keeps the policy as it is by then.
    """
    from qcompile.errors import QcompileError
    from qcompile.output import check_writable, write_file
    from qcompile.policy import save_policy
    from qcompile.policy.files import SUFFIXES
    from qcompile.report.progress import progress_bar
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.presets import settings_for
    from qcompile.rl.rollout import FinishedEpisode

    if out.suffix not in SUFFIXES:
        raise click.BadParameter(f"{out} must end with .pt or .json.", param_hint="'--out'")
    if log is not None:
        if log.resolve() == out.resolve():
            raise click.BadParameter(f"{log} is the policy file.", param_hint="'--log'")
        check_writable(log)
    check_writable(out)
    changed: dict[str, Any] = {} if reuse is None else {"reuse": reuse}
    if episodes is not None or steps is not None:
        changed |= {"episodes": episodes, "steps": steps}
    settings = replace(settings_for(preset, environment, layout), **changed)
    trainer = Trainer(environment, settings, seed)
    rewards: list[float] = []
    with progress_bar(f"{environment}, {preset}", 1.0) as show:

        def note(episode: FinishedEpisode, done: float) -> None:
            rewards.append(episode.reward)
            last = rewards[-20:]
            show(done, f"episode {episode.episode}, last 20: {sum(last) / len(last):.1f}")

        result = trainer.train(note)
    policy = replace(result.policy, name=out.stem)
    save_policy(policy, out)
    if log is not None:
        from io import StringIO

        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["episode", "steps", "reward"])
        writer.writerows([e.episode, e.steps, e.reward] for e in result.episodes)
        write_file(log, text.getvalue().encode())
    last = rewards[-20:]
    average = sum(last) / len(last) if last else None
    if as_json:
        echo_json(
            {
                "environment": environment,
                "model": model,
                "preset": preset,
                "seed": seed,
                "episodes": len(result.episodes),
                "steps": result.steps,
                "parameters": policy.parameter_count,
                "last_20_mean_reward": average,
                "out": str(out),
                "interrupted": result.interrupted,
            }
        )
    else:
        words = "no episode finished" if average is None else f"last 20: {average:.1f}"
        click.echo(
            f"{len(result.episodes)} episodes, {result.steps} steps, {words}; "
            f"{policy.parameter_count} parameters in {out}"
        )
    if result.interrupted:
        raise QcompileError("Interrupted.", f"The policy as it was by then is in {out}.")
