"""The files and the closing words of `qcompile train`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.options import check_distinct

if TYPE_CHECKING:
    from qcompile.rl.ppo import Trainer, TrainingResult
    from qcompile.rl.watch import Watch


def check_outputs(
    trainer: Trainer,
    out: Path,
    checkpoint: Path | None,
    log: Path | None,
    resume: Path | None,
    tensorboard: Path | None,
) -> None:
    """Raise, before any training, where a file cannot be written or would replace another.

    Raises:
        click.BadParameter: a wrong suffix, a name that no policy can have, or options whose files
            are the same or lie in each other.
        OutputError: a file that cannot be written.
    """
    from qcompile.output import check_writable
    from qcompile.policy.files import SUFFIXES

    has_policy = trainer.policy() is not None
    if out.suffix not in SUFFIXES:
        raise click.BadParameter(f"{out} must end with .pt or .json.", param_hint="'--out'")
    if not has_policy and out.suffix != ".pt":
        raise click.BadParameter(
            f"{out} must end with .pt: model {trainer.settings.model!r} is no one-qubit circuits "
            "and is kept as its checkpoint.",
            param_hint="'--out'",
        )
    if not out.stem.isprintable():
        raise click.BadParameter(
            f"{str(out)!a} must have a name of printable characters: it names the policy.",
            param_hint="'--out'",
        )
    named = {
        "--out": out,
        "--resume": resume,
        "--checkpoint": checkpoint,
        "--log": log,
        "--tensorboard": tensorboard,
    }
    allowed = [frozenset({"--resume", "--checkpoint"})]
    if not has_policy:
        allowed += [frozenset({"--out", other}) for other in ("--resume", "--checkpoint")]
    taken = check_distinct(named, allowed)
    for inner, option in taken.items():
        for outer in inner.parents:
            if outer in taken and taken[outer] != "--tensorboard" and not outer.is_dir():
                raise click.BadParameter(
                    f"{inner} lies in the file of {taken[outer]}.", param_hint=f"'{option}'"
                )
    for path in (log, checkpoint, out):
        if path is not None:
            check_writable(path)


def write_out(out: Path, watch: Watch, result: TrainingResult, trainer: Trainer) -> int:
    """Write the policy, or the checkpoint of a model that has none; how many parameters it has."""
    from qcompile.policy import save_policy

    if result.policy is None:
        watch.save(out)
        return trainer.parameter_count
    save_policy(replace(result.policy, name=out.stem), out)
    return result.policy.parameter_count


def closing_words(out: Path, watch: Watch, result: TrainingResult, parameters: int) -> str:
    """What was trained, how it did, and where it is."""
    words = [f"{len(result.episodes)} episodes, {result.steps} steps"]
    averages = watch.averages
    if not result.episodes:
        words.append("no episode finished")
    if averages.last is not None:
        words.append(f"last 20: {averages.last:.1f}")
    if averages.best is not None:
        words.append(f"best 20: {averages.best:.1f}")
    if watch.evaluations:
        words.append(f"evaluation: {watch.evaluations[-1].mean_reward:.1f}")
    told = f"{', '.join(words)}; {parameters} parameters in {out}"
    if result.policy is None:
        told += (
            f"\n{out} is a checkpoint: `qcompile train --resume` reads it, but this model is no "
            "one-qubit circuits and does not run on a device."
        )
    return told


def way_on(
    environment: str, out: Path, checkpoint: Path | None, result: TrainingResult
) -> list[str]:
    """After Ctrl-C: what was kept, and the command that goes on, if there is one."""
    what = "model" if result.policy is None else "policy"
    hints = [f"The {what} as it was by then is in {out}."]
    kept = checkpoint or (out if result.policy is None else None)
    if kept is not None:
        hints.append(f"Go on with: qcompile train {environment} --resume {kept} --out {out}")
    return hints
