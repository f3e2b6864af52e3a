"""Episodes on a live backend: recorded step by step, and played again from the record."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.lockstep import Act
from qcompile.deploy.play import play
from qcompile.errors import LiveError, ReplayError
from qcompile.live.executor import IBMExecutor
from qcompile.live.journal import Journal, TaskKind
from qcompile.live.task import Context, Task
from qcompile.policy.schema import AnyPolicyFile

_ROUNDING = 1e-9
"""Another processor may round the last digits otherwise."""


class RunTask(Task):
    """Play `episodes` with a policy, as `qcompile run` does; the options are those of its command.

    `calibration` mitigates instead of measuring first; `calibration_file` is the file it came from.
    """

    kind: ClassVar[TaskKind] = "run"

    policy: AnyPolicyFile
    shots: int
    episodes: int
    seed: int
    level: int
    mitigation: str
    calibration: Calibration | None = None
    calibration_file: str | None = None
    predistort: bool = False
    greedy: bool = False
    copies: int = 1
    max_steps: int | None = None

    @property
    def name(self) -> str:
        return self.policy.name

    def perform(self, context: Context) -> dict[str, Any]:
        """The figures of `qcompile run --json`.

        Raises:
            LiveError: a job cannot be had.
            ReplayError: the environment does not repeat what is recorded.
        """
        deployment = self.deploy(IBMExecutor(self.device, context.jobs))
        actions = len(deployment.policy.bias)
        steps = Steps(context.jobs.journal, actions, context.say)
        result = play(
            deployment,
            self.episodes,
            max_steps=self.max_steps,
            record=steps,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        return result.summary(self.calibration_file)

    def deploy(self, executor: Any) -> Deployment:
        """The task's policy on an executor of the task's device."""
        return Deployment(
            self.policy.policy(),
            executor,
            shots=self.shots,
            level=self.level,
            mitigation=self.mitigation,
            calibration=self.calibration,
            predistort=self.predistort,
            greedy=self.greedy,
            seed=self.seed,
            copies=self.copies,
        )


class Steps:
    """Records the steps of a run; those that the journal has are played again and checked.

    A recorded step takes its recorded actions. The deployment is asked for them all the same: its
    counts come from the journal, and it draws what it drew then, so the next new step goes on as if
    nothing had happened. The actions lie in [0, `actions`).
    """

    def __init__(
        self, journal: Journal, actions: int, say: Callable[[str], None] = lambda words: None
    ):
        self._journal, self._actions, self._say, self._number = journal, actions, say, 0

    def act(self, act: Act, observations: NDArray[np.float64]) -> NDArray[np.intp]:
        """The actions (B,) for observations (B, features).

        Raises:
            LiveError: the recorded actions are damaged.
            ReplayError: the observations are not those recorded.
        """
        step = self._journal.step(self._number)
        self._say(f"step {self._number + 1}")
        if step is None:
            actions = act(observations)
            self._journal.note_actions(self._number, observations, actions)
            return actions
        self._check("observations", step.observations, observations)
        drawn, recorded = act(observations), step.actions
        if recorded.shape != drawn.shape or not np.isin(recorded, range(self._actions)).all():
            raise LiveError(
                f"{self._journal.path} is damaged: the actions of step {self._number} are wrong.",
                "Restore a copy.",
            )
        return recorded.astype(np.intp)

    def rewards(self, rewards: list[float]) -> None:
        """What the last actions earned.

        Raises:
            ReplayError: it is not what is recorded.
        """
        step = self._journal.step(self._number)
        if step is None or step.rewards is None:
            self._journal.note_rewards(self._number, rewards)
        else:
            self._check("rewards", step.rewards, np.array(rewards))
        self._number += 1

    def _check(self, what: str, recorded: NDArray[Any], found: NDArray[Any]) -> None:
        same = recorded.shape == found.shape
        if not same or not np.allclose(recorded, found, _ROUNDING, _ROUNDING, equal_nan=True):
            raise ReplayError(
                f"The {what} of step {self._number} are not those recorded: the environment does "
                "not repeat itself."
            )
