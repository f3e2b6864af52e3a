"""`qcompile train`: make a policy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from qcompile.cli.assignments import Assignment, as_mapping
from qcompile.cli.options import (
    Shots,
    echo_json,
    echo_note,
    env_option,
    import_option,
    json_option,
)
from qcompile.cli.outputs import Outputs, output_options
from qcompile.limits import MAX_EPISODES

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command("train")
@click.argument("environment")
@click.option(
    "--model",
    type=click.Choice(["svqc", "mvqc", "fcn", "cnn", "surrogate"]),
    help="One-qubit circuits, an entangling circuit, a fully connected or a convolutional network, "
    "or the classical functions that the one-qubit circuits amount to.  [default: svqc]",
)
@click.option(
    "--preset",
    type=click.Choice(["paper", "tuned", "hardware"]),
    help="paper: arXiv 2203.14348 as it stands; tuned: ours; hardware: ours for few QPU seconds, "
    "holds decisions and learns under noise, svqc.  [default: tuned]",
)
@click.option(
    "--layout",
    type=click.Choice(["parallel", "serial", "single"]),
    help="A circuit per feature and copy, re-uploading, or one circuit for three features; svqc. "
    " [default: parallel]",
)
@click.option(
    "--reuse",
    type=click.IntRange(1, 1000),
    help="Copies of each output in training; svqc, mvqc, surrogate.",
)
@click.option("--seed", type=click.IntRange(0), help="[default: 0]")
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
    "settings",
    type=Assignment(),
    multiple=True,
    callback=as_mapping,
    metavar="NAME=VALUE",
    help="Change a setting of the preset; repeatable. As in clip=0.1, hidden=64,64 or "
    "minibatch=none.",
)
@click.option(
    "--backend",
    metavar="NAME",
    help="Device whose noise the policy learns under; svqc.  [default: ideal]",
)
@click.option(
    "--shots",
    type=Shots(meaning="exact"),
    help="Shots of each circuit while it learns; svqc. "
    " [default: 1024 on a noisy backend, exact on ideal]",
)
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout"]),
    help="Undo readout errors; svqc.  [default: readout on a noisy backend, none on ideal]",
)
@click.option(
    "--hold",
    type=click.IntRange(1),
    metavar="STEPS",
    help="Decide once in this many steps of the environment and repeat the action between; "
    "whatever plays the policy does so.  [default: the preset's: 1, more with hardware]",
)
@import_option
@env_option
@click.option(
    "--circuits",
    metavar="FILE",
    help="Train the circuits of this policy (a file or a name), OpenQASM file or file of circuits "
    "in place of a layout, with a new head; svqc.",
)
@click.option(
    "--init",
    metavar="POLICY",
    help="Start from this policy, a file or a name: its circuits or its layers, and all of its "
    "numbers; svqc, fcn, cnn.",
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
    help="Test episodes of an evaluation.  [default: 20]",
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
    help="Resume from this checkpoint with its settings and seed, and keep it up to date.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    help="Train with so many seeds, from --seed on, side by side; --out is the best of them.",
)
@click.option(
    "--evaluation",
    type=click.IntRange(1, MAX_EPISODES),
    metavar="EPISODES",
    help="With --seeds: fresh episodes by which the best is chosen.  [default: 100]",
)
@click.option(
    "--workers",
    type=click.IntRange(1, 10_000),
    help="With --seeds: trainings at a time.  [default: one for each core]",
)
@click.option(
    "--out",
    type=_FILE,
    required=True,
    help="Policy file to write, .pt or .json. For mvqc, an entangling circuit that is not played "
    "yet, its checkpoint, .pt.",
)
@click.option(
    "--force",
    is_flag=True,
    help="Overwrite the files of --out and --checkpoint. A resumed training needs it for files of "
    "other trainings alone.",
)
@output_options("the learning curve of each training")
@json_option
def command(environment: str, as_json: bool, outputs: Outputs, **options: Any) -> None:
    """Train a policy in ENVIRONMENT, such as CartPole-v1, with PPO.

    Ctrl-C ends the training and keeps the policy as it is by then; with --checkpoint, --resume
    continues from there as if nothing had happened.
    """
    from qcompile.report.tables import print_table
    from qcompile.verbs.train import train

    training = train(environment, **options, on_note=echo_note)
    if as_json:
        echo_json(training.to_dict())
    else:
        if options["seeds"] is not None:
            table = training.table()
            print_table(table.header, table.words, right=range(5))
        click.echo(training.words)
    try:
        outputs.save(training, quiet=as_json)
    finally:
        training.check_complete()
