"""One training from its first step to its files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qcompile.errors import EnvironmentStepError, QcompileError, TrainingError
from qcompile.report.progress import Show
from qcompile.verbs.train_outputs import TrainingOutputs
from qcompile.verbs.training import Training

if TYPE_CHECKING:
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.training_log import Callback
    from qcompile.rl.watch import Watch


@dataclass(frozen=True, kw_only=True)
class WatchRequest:
    """The arguments of `train` about watching a training.

    `evaluate_episodes` are played after every `evaluate_every` episodes. `preset` and `imports` are
    named in the result.
    """

    evaluate_every: int | None
    evaluate_episodes: int
    preset: str | None
    imports: Sequence[str] = ()
    callback: Callback | None = None


def train_one(
    trainer: Trainer, outputs: TrainingOutputs, request: WatchRequest, show: Show
) -> Training:
    """Train to the end, or to Ctrl-C, and write the files.

    Raises:
        QcompileError: an environment fails before anything was learned.
        OutputError: a file cannot be written.
        Exception: the callback's error, with a note, after the files are written.
    """
    from qcompile.rl.training_log import EpisodeLog, TensorBoard
    from qcompile.rl.watch import Watch

    failure: QcompileError | None = None
    with ExitStack() as stack:
        watch = Watch(
            trainer, show, outputs.checkpoint, request.evaluate_every, request.evaluate_episodes
        )
        if outputs.tensorboard is not None:
            board = TensorBoard(outputs.tensorboard, trainer.steps)
            watch.callbacks.append(stack.enter_context(board))
        if request.callback is not None:
            watch.callbacks.append(request.callback)
        if outputs.log is not None:
            watch.log = stack.enter_context(EpisodeLog(outputs.log, trainer.history))
        try:
            result = watch.train()
        except Exception as error:
            if error is watch.callback_error:
                error.add_note(_save_learned(trainer, outputs, watch))
                raise
            if not isinstance(error, EnvironmentStepError | TrainingError):
                raise
            if not watch.has_learned:
                raise error.with_hints(_nothing_learned(outputs)) from error
            failure, result = error, trainer.result(interrupted=True)
    return Training(
        trainer=trainer,
        policy=outputs.named(result.policy),
        watch=watch,
        outputs=outputs,
        imports=request.imports,
        preset=request.preset,
        interrupted=result.interrupted,
        failure=failure,
    )


def _save_learned(trainer: Trainer, outputs: TrainingOutputs, watch: Watch) -> str:
    """Write what was learned before a callback failed; a sentence about where it is."""
    if not watch.has_learned:
        return _nothing_learned(outputs)
    outputs.named(trainer.result(interrupted=True).policy)
    if outputs.out is None:
        return "With out or checkpoint, what was learned would have been saved."
    return f"The policy trained so far is in {outputs.out}."


def _nothing_learned(outputs: TrainingOutputs) -> str:
    hint = "Nothing was learned yet"
    return f"{hint}." if outputs.out is None else f"{hint}, so {outputs.out} was not written."
