"""The same training with several seeds, in parallel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from qcompile.caller import option
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
"""First reset seeds of the episodes that choose the best policy, and of those that score it."""


@dataclass(frozen=True)
class SeedsRequest:
    """A training with `seeds` seeds, each of which plays `evaluation` episodes (None: 100).

    Raises:
        OptionError: an argument can only be used with a single seed.
    """

    request: TrainingRequest
    outputs: TrainingOutputs
    watch: WatchRequest
    seeds: int
    evaluation: int | None

    def __post_init__(self) -> None:
        if self.outputs.resume is not None:
            raise OptionError(
                f"{option('resume')} cannot be combined with {option('seeds')}: a checkpoint "
                "belongs to one training."
            )
        if self.watch.callback is not None:
            raise OptionError(
                "callback cannot be combined with seeds, which are trained in other processes.",
                "Call train for each seed.",
            )

    def cells(self) -> list[_Seed]:
        """Check the files of all trainings, and return the trainings.

        Raises:
            OptionError: files contradict each other.
            QcompileError: settings or files cannot be used.
        """
        trainer = self.request.trainer()
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
    seeds_request: SeedsRequest, workers: int | None, progress: bool, on_note: Words
) -> Trainings:
    """Train every seed, and write the policy of the best.

    Raises:
        QcompileError: options, settings or files cannot be used; no training was finished.
    """
    cells = seeds_request.cells()
    evaluation = FRESH_EPISODES if seeds_request.evaluation is None else seeds_request.evaluation
    scored: dict[int, Scored] = {}
    failures: dict[int, str] = {}
    interrupted, failure = False, None
    title = f"{seeds_request.request.environment}, {len(cells)} seeds"
    with bars.progress_bar(title, len(cells), enabled=progress) as show:

        def keep(cell: _Seed, outcome: Scored | str) -> None:
            if isinstance(outcome, str):
                failures[cell.seed], words = outcome, "failed"
            else:
                scored[cell.seed], words = outcome, reward_text(outcome.rewards.mean())
            show(len(scored) + len(failures), f"{cell.name}: {words}")

        train = with_environments(
            partial(_train, evaluation=evaluation), [seeds_request.request.environment]
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
        finished = f"0 of {len(cells)} trainings finished."
        words = [f"Seed {seed}: {text}" for seed, text in sorted(failures.items())]
        raise QcompileError(f"Interrupted: {finished}" if interrupted else finished, *words)
    ordered = [scored[seed] for seed in sorted(scored)]
    return Trainings(
        ordered,
        policy=seeds_request.outputs.named(best_of(ordered).training.policy),
        requested=len(cells),
        failures=dict(sorted(failures.items())),
        out=seeds_request.outputs.out,
        interrupted=interrupted,
        failure=failure,
    )


def _train(cell: _Seed, evaluation: int) -> Scored | str:
    """A training and its scores, or the message of its failure.

    Raises:
        KeyboardInterrupt: Ctrl-C; an unfinished training is not a result.
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
