"""`qcompile train`: make a policy."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from qcompile.cli.options import Shots, echo_json, json_option
from qcompile.cli.train_outputs import check_outputs, closing_words, way_on, write_out
from qcompile.cli.train_settings import NOISY_SHOTS, chosen_settings, given, resumed
from qcompile.limits import MAX_EPISODES

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command("train")
@click.argument("environment")
@click.option(
    "--model",
    type=click.Choice(["svqc", "mvqc", "fcn", "cnn", "surrogate"]),
    default="svqc",
    show_default=True,
    help="One-qubit circuits, an entangling circuit, a fully connected or a convolutional network, "
    "or the classical functions that the one-qubit circuits amount to.",
)
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
    help="A circuit per feature and copy, re-uploading, or one circuit for three features; svqc.",
)
@click.option(
    "--reuse",
    type=click.IntRange(1, 1000),
    help="Copies of each output in training; svqc, mvqc, surrogate.",
)
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
    "-s",
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a setting of the preset; repeatable. As in clip=0.1, hidden=64,64 or "
    "minibatch=none.",
)
@click.option(
    "--backend",
    default="ideal",
    show_default=True,
    metavar="NAME",
    help="Device whose noise the policy learns under; svqc.",
)
@click.option(
    "--shots",
    type=Shots(),
    help="Shots of each circuit while it learns; svqc. "
    f" [default: {NOISY_SHOTS} on a noisy backend, exact on ideal]",
)
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout"]),
    help="Undo readout errors; svqc.  [default: readout on a noisy backend, none on ideal]",
)
@click.option(
    "--evaluate-every",
    type=click.IntRange(1),
    metavar="EPISODES",
    help="Play test episodes after every so many episodes; the training is not disturbed.",
)
@click.option(
    "--evaluate-episodes",
    type=click.IntRange(1, MAX_EPISODES),
    default=20,
    show_default=True,
    help="Test episodes of an evaluation.",
)
@click.option(
    "--log",
    type=_FILE,
    help="CSV, a row for each episode: its number, all steps taken by its end, its reward.",
)
@click.option(
    "--tensorboard",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Rewards, losses and evaluations for TensorBoard.",
)
@click.option(
    "--checkpoint", type=_FILE, help="State to resume from, rewritten every 10 s and at the end."
)
@click.option(
    "--resume",
    type=_FILE,
    help="Go on from this checkpoint with its settings and seed, and keep it up to date.",
)
@click.option(
    "--out",
    type=_FILE,
    required=True,
    help="Policy file to write, .pt or .json; overwritten. For mvqc, fcn and cnn, which are no "
    "one-qubit circuits, their checkpoint, .pt.",
)
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    environment: str,
    seed: int,
    preset: str,
    evaluate_every: int | None,
    evaluate_episodes: int,
    log: Path | None,
    tensorboard: Path | None,
    checkpoint: Path | None,
    resume: Path | None,
    out: Path,
    as_json: bool,
    **_: Any,
) -> None:
    """Train a policy in ENVIRONMENT, such as CartPole-v1, with PPO.

    Ctrl-C ends the training and keeps the policy as it is by then; with --checkpoint, --resume
    goes on from there as if nothing had happened.
    """
    from qcompile.errors import EnvironmentStepError, QcompileError, TrainingError
    from qcompile.report.progress import progress_bar
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.training_log import EpisodeLog, Scalars
    from qcompile.rl.watch import Watch

    if given(ctx, "evaluate_episodes") and evaluate_every is None:
        raise click.UsageError("--evaluate-episodes needs --evaluate-every.")
    if resume is None:
        trainer = Trainer(environment, chosen_settings(ctx), seed)
    else:
        trainer = resumed(ctx, resume)
    settings, checkpoint = trainer.settings, checkpoint or resume
    check_outputs(trainer, out, checkpoint, log, resume, tensorboard)
    if trainer.progress >= 1.0:
        click.echo(f"The training of {resume} was finished; only its outputs are made.", err=True)
    with ExitStack() as stack:
        show = stack.enter_context(progress_bar(environment, 1.0))
        watch = Watch(trainer, show, checkpoint, evaluate_every, evaluate_episodes)
        if tensorboard is not None:
            watch.scalars = stack.enter_context(Scalars(tensorboard, trainer.steps))
        if log is not None:
            watch.log = stack.enter_context(EpisodeLog(log, trainer.history))
        failure: QcompileError | None = None
        try:
            result = watch.train()
        except (EnvironmentStepError, TrainingError) as error:
            if not watch.has_learned:
                hint = f"Nothing was learned by then: {out} is not written."
                raise error.with_hints(hint) from error
            failure, result = error, trainer.result(interrupted=True)
    parameters = write_out(out, watch, result, trainer)
    if as_json:
        echo_json(
            {
                "environment": environment,
                "model": settings.model,
                "preset": None if resume else preset,
                "seed": trainer.seed,
                "backend": settings.backend,
                "shots": "exact" if settings.shots is None else settings.shots,
                "mitigation": settings.mitigation,
                "episodes": len(result.episodes),
                "steps": result.steps,
                "parameters": parameters,
                "last_20_mean_reward": watch.averages.last,
                "best_20_mean_reward": watch.averages.best,
                "evaluations": [vars(evaluation) for evaluation in watch.evaluations],
                "checkpoint": None if checkpoint is None else str(checkpoint),
                "out": str(out),
                "interrupted": result.interrupted,
            }
        )
    else:
        click.echo(closing_words(out, watch, result, parameters))
    if failure is not None:
        what = "model" if result.policy is None else "policy"
        raise failure.with_hints(f"The {what} as it was after the last whole update is in {out}.")
    if result.interrupted:
        raise QcompileError("Interrupted.", *way_on(environment, out, checkpoint, result))
