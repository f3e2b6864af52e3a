"""`qcompile train`: train a policy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from qcompile.cli.assignments import Assignment, as_mapping
from qcompile.cli.options import echo_json, echo_note, env_option, import_option, json_option
from qcompile.cli.outputs import Outputs, output_options
from qcompile.cli.types import Integer, Shots
from qcompile.limits import MAX_EPISODES

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command("train")
@click.argument("environment")
@click.option(
    "--model",
    type=click.Choice(["svqc", "mvqc", "fcn", "cnn", "surrogate"]),
    help="svqc: one-qubit circuits; mvqc: one circuit with entangling gates, a qubit per feature; "
    "fcn, cnn: fully connected or convolutional neural network; surrogate: the classical functions "
    "that one-qubit circuits compute.  [default: svqc]",
)
@click.option(
    "--preset",
    type=click.Choice(["paper", "tuned", "hardware"]),
    help="Training settings. paper: as in arXiv 2203.14348; tuned: improved; hardware: for svqc "
    "policies that need few QPU seconds, trained under noise and holding each action for several "
    "steps.  [default: tuned]",
)
@click.option(
    "--layout",
    type=click.Choice(["parallel", "serial", "single"]),
    help="Circuits of svqc. parallel: one per feature; serial: data re-uploading, all features in "
    "turn; single: one circuit for three features.  [default: parallel]",
)
@click.option(
    "--reuse",
    type=Integer(1, 1000),
    help="Output reuse: copies of each circuit output in training; svqc, mvqc, surrogate.",
)
@click.option("--seed", type=Integer(0), help="Seed of the training.  [default: 0]")
@click.option(
    "--episodes",
    type=Integer(1),
    metavar="N",
    help="Stop after N episodes.  [default: the preset's]",
)
@click.option(
    "--steps",
    type=Integer(1),
    metavar="N",
    help="Stop after N environment steps.  [default: the preset's]",
)
@click.option(
    "-s",
    "--set",
    "settings",
    type=Assignment(),
    multiple=True,
    callback=as_mapping,
    metavar="NAME=VALUE",
    help="Change a setting of the preset, such as clip=0.1, hidden=64,64 or minibatch=none; "
    "repeatable.",
)
@click.option(
    "--backend",
    metavar="NAME",
    help="Device whose noise model the policy is trained on; svqc, mvqc.  [default: ideal]",
)
@click.option(
    "--shots",
    type=Shots(meaning="exact"),
    help="Shots of each circuit in training; svqc, mvqc.  [default: 1024 on a noisy backend, exact "
    "on ideal]",
)
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout"]),
    help="Errors to correct in training; svqc, mvqc.  [default: readout on a noisy backend, none "
    "on ideal]",
)
@click.option(
    "--hold",
    type=Integer(1),
    metavar="STEPS",
    help="Repeat each action for this many environment steps; the policy is always played this "
    "way.  [default: the preset's: 1, or more with hardware]",
)
@import_option
@env_option
@click.option(
    "--circuits",
    metavar="FILE",
    help="Train these circuits instead of a layout, with new output weights; svqc, or mvqc if one "
    "has several qubits. FILE is a policy (name or file), an OpenQASM file or a file of circuits.",
)
@click.option(
    "--init",
    metavar="POLICY",
    help="Start from all parameters of this policy (name or file); svqc, mvqc, fcn, cnn.",
)
@click.option(
    "--evaluate-every",
    type=Integer(1),
    metavar="EPISODES",
    help="Play test episodes each time this many training episodes have ended. This does not "
    "change the training.",
)
@click.option(
    "--evaluate-episodes",
    type=Integer(1, MAX_EPISODES),
    help="Number of test episodes each time.  [default: 20]",
)
@click.option(
    "--log",
    type=_FILE,
    help="CSV file with a row per episode: number, total steps so far, reward.",
)
@click.option(
    "--tensorboard",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write rewards, losses and evaluations for TensorBoard.",
)
@click.option(
    "--checkpoint", type=_FILE, help="File for the state to resume from, saved every 10 s."
)
@click.option(
    "--resume",
    type=_FILE,
    help="Resume from this checkpoint, with its settings and seed, and keep updating it.",
)
@click.option(
    "--seeds",
    type=Integer(1, 1000),
    metavar="N",
    help="Train with N seeds in parallel, starting at --seed; --out gets the best policy.",
)
@click.option(
    "--evaluation",
    type=Integer(1, MAX_EPISODES),
    metavar="EPISODES",
    help="With --seeds: episodes that choose the best policy.  [default: 100]",
)
@click.option(
    "--workers",
    type=Integer(1, 10_000),
    help="With --seeds: trainings to run at a time.  [default: one per core]",
)
@click.option(
    "--out",
    type=_FILE,
    required=True,
    help="Policy file to write, .pt or .json.",
)
@click.option(
    "--force",
    is_flag=True,
    help="Overwrite --out and --checkpoint. A resumed training overwrites its own files without "
    "--force.",
)
@output_options("the learning curve of each training", "curves")
@json_option
def command(environment: str, as_json: bool, outputs: Outputs, **options: Any) -> None:
    """Train a policy in ENVIRONMENT, such as CartPole-v1, with PPO.

    Ctrl-C ends the training and writes the policy as it is. With --checkpoint, the training can be
    resumed later with --resume, and gives the same result as without the interruption.

    Model names at the end of an option's description are the models that it applies to.
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
    is_empty = training.interrupted and not training.episodes
    outputs.save(training, training.check_complete, is_empty=is_empty)
