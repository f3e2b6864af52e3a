"""Episodes on a live backend, recorded step by step and replayed from the record."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.lockstep import Act
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.errors import LiveError, ReplayError
from qcompile.execution import Backend, Executor
from qcompile.live.journal import Journal, TaskKind
from qcompile.live.records import Chains, Step
from qcompile.live.task import Context, DeviceTask
from qcompile.policy.schema import AnyPolicyFile

_ROUNDING = 1e-9
"""Another processor may round the last digits differently."""


class RunTask(DeviceTask, RunSettings):
    """Play `episodes` episodes with a policy and these settings, as `qcompile run` does.

    Journals of earlier versions have no `copy_of`: there a row's copy followed from its position
    among the running episodes.
    """

    kind: ClassVar[TaskKind] = "run"

    policy: AnyPolicyFile
    episodes: int
    copy_of: Literal["episode", "place"] = "place"

    @property
    def name(self) -> str:
        return self.policy.name

    @property
    def settings(self) -> RunSettings:
        return RunSettings.of(self)

    def perform(self, context: Context) -> dict[str, Any]:
        """The figures of `qcompile run --json`.

        Raises:
            LiveError: a job's counts cannot be obtained.
            ReplayError: the environment does not repeat the record.
        """
        deployment = self.deploy(context.executor(self.device))
        actions = len(deployment.policy.bias)
        recorder = JournalRecorder(context.jobs.journal, actions, self.copy_of, context.say)
        run = play(
            deployment, self.episodes, complete=True, recorder=recorder, on_note=context.note
        )
        if run.interrupted:
            raise KeyboardInterrupt
        return run.summary()

    def deploy(self, backend: Device | Backend | Executor) -> Deployment:
        """The task's policy, deployed on an executor of the task's device or on a model of it."""
        return Deployment(self.policy.policy(), backend, self.settings)


class JournalRecorder(Recorder):
    """Records the steps of a run; steps already in the journal are replayed and checked.

    A recorded step takes its recorded actions, which lie in [0, `actions`). The deployment is still
    called, so that counts are read from the journal in the same order. When steps are measured
    ahead, a step is recorded with its predicted actions before it is measured, and a replay follows
    the recorded predictions.
    """

    def __init__(
        self,
        journal: Journal,
        actions: int,
        copy_of: Literal["episode", "place"] = "episode",
        say: Callable[[str], None] = lambda words: None,
    ):
        self._journal, self._actions, self._copy_of, self._say = journal, actions, copy_of, say
        self._number = 0
        self._step: Step | None = None
        self._predicted: list[IntArray] = []
        """The predicted actions for the next step so far, when steps are measured ahead."""

    def depth(self, depth: int) -> int:
        """The number of decisions of each episode in the next step: the recorded number, if any."""
        chains = self._chains()
        return depth if chains is None else chains.depth

    def predict(self, predict: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The predicted actions (B,) that the next step follows: the recorded ones, if any.

        Raises:
            LiveError: the record is damaged.
            ReplayError: the recorded rows differ.
        """
        chains = self._chains()
        if chains is None:
            predicted = predict(observations, rows)
        else:
            first = sum(map(len, self._predicted))
            new_rows = slice(first, first + len(observations))
            self._check("rows", chains.array[:2, new_rows], np.stack(rows[:2]))
            predicted = self._numbered(chains.predicted[new_rows], observations)
        self._predicted.append(predicted)
        return predicted

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) for observations (B, features).

        Raises:
            LiveError: the recorded actions are damaged.
            ReplayError: the observations differ from the recorded ones.
        """
        steps, step = self._journal.steps, self._recorded()
        ahead = f" of {len(observations)} decisions" if self._predicted else ""
        self._say(f"step {self._number + 1}{ahead}")
        if self._copy_of == "place":
            rows = rows._replace(order=np.arange(len(observations)))
        if step is not None:
            self._check("observations", step.observations, observations)
        chains = None
        if self._predicted:
            chains = Chains(rows.episode, rows.decision, np.concatenate(self._predicted))
            if step is None:  # before the job is sent, so that it can be repeated
                steps.note_chains(self._number, observations, chains)
        drawn = act(observations, rows)
        if step is not None and step.actions is not None:
            return self._numbered(step.actions, observations)
        steps.note_actions(self._number, observations, drawn, chains)
        return drawn

    def rewards(self, rewards: list[float]) -> None:
        """Record or check the rewards of the last actions that counted.

        Raises:
            ReplayError: the rewards differ from the recorded ones.
        """
        step = self._recorded()
        if step is None or step.rewards is None:
            self._journal.steps.note_rewards(self._number, rewards)
        else:
            self._check("rewards", step.rewards, np.array(rewards))
        self._number, self._step, self._predicted = self._number + 1, None, []

    def _recorded(self) -> Step | None:
        """The record of the next step, if there is one."""
        if self._step is None:
            self._step = self._journal.steps.at(self._number)
        return self._step

    def _chains(self) -> Chains | None:
        step = self._recorded()
        return None if step is None else step.chains

    def _numbered(self, actions: NDArray[Any], observations: FloatArray) -> IntArray:
        """The recorded actions, checked to be one for each observation.

        Raises:
            LiveError: they are damaged.
        """
        right = actions.shape == (len(observations),)
        if not right or not np.isin(actions, range(self._actions)).all():
            raise LiveError(
                f"{self._journal.path} is damaged: the actions of step {self._number} are not "
                "valid.",
                "Restore a backup.",
            )
        return actions.astype(np.intp)

    def _check(self, what: str, recorded: NDArray[Any], actual: NDArray[Any]) -> None:
        same_shape = recorded.shape == actual.shape
        if not same_shape or not np.allclose(
            recorded, actual, _ROUNDING, _ROUNDING, equal_nan=True
        ):
            raise ReplayError(
                f"The {what} of step {self._number} differ from the recorded ones: the "
                "environment does not repeat itself."
            )
