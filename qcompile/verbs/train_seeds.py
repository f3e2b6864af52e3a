"""The same training with several seeds, side by side on the cores."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from qcompile.deploy.registration import with_environments
from qcompile.errors import OptionError, QcompileError, StudyError
from qcompile.notebook import reward_text
from qcompile.report import progress as bars
from qcompile.sweep.arguments import Words
from qcompile.sweep.engine import run_all
from qcompile.terminal import first_line
from qcompile.verbs.train_one import WatchRequest, train_one
from qcompile.verbs.train_outputs import TrainingOutputs
from qcompile.verbs.train_settings import TrainingRequest
from qcompile.verbs.trainings import Scored, Trainings, best_of

FRESH_EPISODES = 100
CHOICE_SEED, OTHER_SEED = 2_000_000, 3_000_000
"""From here on are the reset seeds of the episodes by which the best is chosen, and of those on
which it is then scored."""


@dataclass(frozen=True)
class SeedsRequest:
    """What is trained with `seeds` seeds, and how many fresh episodes judge each; None is 100.

    Raises:
        OptionError: something stands beside it that goes with one seed alone.
    """

    request: TrainingRequest
    outputs: TrainingOutputs
    watch: WatchRequest
    seeds: int
    evaluation: int | None

    def __post_init__(self) -> None:
        if self.outputs.resume is not None:
            raise OptionError("resume goes without seeds: a checkpoint is of one training.")
        if self.watch.callback is not None:
            raise OptionError(
                "callback goes without seeds, which are trained in processes of their own.",
                "Call train for each seed.",
            )

    def cells(self) -> list[_Seed]:
        """The trainings, once their files are checked.

        Raises:
            OptionError: the model makes no policy, or files contradict each other.
            QcompileError: settings or files that cannot be used.
        """
        trainer = self.request.trainer()
        if trainer.policy() is None:
            raise OptionError(
                f"Model {trainer.settings.model!r} makes no policy, so seeds have no best one.",
                "Train each seed by itself, with --seed.",
            )
        cells = []
        for seed in range(trainer.seed, trainer.seed + self.seeds):
            outputs = self.outputs.of_seed(seed)
            replace(outputs, out=self.outputs.out).check(trainer)
            request = replace(self.request, seed=seed)
            cells.append(_Seed(seed, request, outputs, self.watch))
        return cells


@dataclass(frozen=True)
class _Seed:
    seed: int
    request: TrainingRequest
    outputs: TrainingOutputs
    watch: WatchRequest

    @property
    def name(self) -> str:
        return f"seed {self.seed}"


def train_seeds(
    asked: SeedsRequest, workers: int | None, progress: bool, on_note: Words
) -> Trainings:
    """Train every seed, and write the policy of the best.

    Raises:
        QcompileError: options, settings or files that cannot be used; no training came to its end.
    """
    cells = asked.cells()
    evaluation = FRESH_EPISODES if asked.evaluation is None else asked.evaluation
    scored: dict[int, Scored] = {}
    failures: dict[int, str] = {}
    interrupted, failure = False, None
    title = f"{asked.request.environment}, {len(cells)} seeds"
    with bars.progress_bar(title, len(cells), enabled=progress) as show:

        def keep(cell: _Seed, outcome: Scored | str) -> None:
            if isinstance(outcome, str):
                failures[cell.seed], words = outcome, "failed"
            else:
                scored[cell.seed], words = outcome, reward_text(outcome.rewards.mean())
            show(len(scored) + len(failures), f"{cell.name}: {words}")

        train = with_environments(
            partial(_train, evaluation=evaluation), [asked.request.environment]
        )
        try:
            run_all(cells, train, keep, workers=workers, on_loss=on_note, noun="training")
        except KeyboardInterrupt:
            interrupted = True
        except StudyError as error:  # its hints are about a study's folder
            failure = QcompileError(first_line(str(error)))
    if not scored:
        if failure is not None:
            raise failure
        what = f"0 of {len(cells)} trainings were finished."
        words = [f"Seed {seed}: {text}" for seed, text in sorted(failures.items())]
        raise QcompileError(f"Interrupted: {what}" if interrupted else what, *words)
    ordered = [scored[seed] for seed in sorted(scored)]
    policy = best_of(ordered).training.policy
    return Trainings(
        ordered,
        policy=None if policy is None else asked.outputs.named(policy),
        asked=len(cells),
        failures=dict(sorted(failures.items())),
        out=asked.outputs.out,
        interrupted=interrupted,
        failure=failure,
    )


def _train(cell: _Seed, evaluation: int) -> Scored | str:
    """A training and its scores, or why there are none, in words.

    Raises:
        KeyboardInterrupt: Ctrl-C; half a training is no result.
    """
    import torch

    from qcompile.rl.score import score

    torch.set_num_threads(1)
    try:
        trainer = cell.request.trainer()
        training = train_one(trainer, cell.outputs, cell.watch, lambda done, words: None)
        if training.failure is not None:
            return str(training.failure)
        if training.interrupted:
            raise KeyboardInterrupt
        rewards, others = (score(trainer, evaluation, at) for at in (CHOICE_SEED, OTHER_SEED))
    except QcompileError as error:
        return str(error)
    return Scored(training, rewards, others)
