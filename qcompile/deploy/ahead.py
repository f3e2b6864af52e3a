"""Play episodes side by side, with several decisions of each measured in one job.

A simulated environment can be run ahead. Which action a decision takes is a function of what is
measured and of a uniform number that is known beforehand, so it can be predicted without measuring:
a *scout*, a second environment of the episode, walks along the predicted actions, and all that it
observes is measured in one job. Then the episode itself takes measured actions as long as they are
the predicted ones. The first that is not still counts: it was measured on what the episode
observes. What lies beyond is thrown away, and the scout is rebuilt by playing the accepted actions
again.

Every decision that counts was measured on its own observation, by shots of its own, and decided by
its own uniform number; the prediction only says what else is measured. So the episodes have the law
of the ordinary closed loop, under conditions that are kept here: how many decisions a job measures
depends on earlier jobs alone; counts serve once, those of a row that was thrown away never; rows of
one episode share no execution, and where a row is measured follows from its episode and decision
(`deploy/rows.py`); the environment that counts takes accepted actions alone; and whatever two
environments of an episode show for the same actions is compared bit for bit. Where it differs, what
was measured beyond does not count, and from then on a job measures one decision of each.

Source: speculative decoding (Leviathan, Kalman, Matias, ICML 2023; Chen et al., arXiv 2302.01318),
with a deterministic environment between the draws.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.wrappers.utils import RunningMeanStd
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.environments import Environment, environment_name
from qcompile.deploy.lockstep import Act, Episode
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper, check_finite
from qcompile.errors import EnvironmentStepError, OptionError


@dataclass(frozen=True)
class Foresight:
    """What episodes are run ahead with.

    `predict` maps observations and rows to actions, as `Act` does, and costs nothing; `scouts` are
    environments like those of the episodes, one for each, or none where they cannot be made.
    `depth` says, for the numbers of the living episodes, how many decisions of each the next job
    measures; `note` is told after every job how many of its rows counted, and how many of these
    were predicted right. `say` gets a line where an environment does not repeat itself.
    """

    predict: Act
    scouts: Sequence[Environment]
    depth: Callable[[IntArray], int]
    note: Callable[[int, int], None]
    say: Callable[[str], None]


def ahead(
    act: Act,
    environments: list[Environment],
    first_seed: int,
    *,
    foresight: Foresight,
    hold: int = 1,
    episodes: Sequence[int] | None = None,
    max_steps: int | None = None,
    on_begin: Callable[[Sequence[Stepper]], None] = lambda steppers: None,
    on_rewards: Callable[[list[float]], None] = lambda rewards: None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
) -> None:
    """Play one episode in every environment, as `lockstep`, whose law it has.

    `act` gets the rows of a job, those of the first decision of each living episode first; of the
    actions (B,) that it gives those are taken that count. `on_rewards` gets what these earned, one
    episode after the other.

    Raises:
        EnvironmentStepError: an environment fails, or gives what no policy can use; a scout that
            does so only ends its chain.
    """
    numbers = range(len(environments)) if episodes is None else episodes
    living = [
        _Pair(number, *(Stepper(one, hold, max_steps) for one in both))
        for number, *both in zip(
            numbers, environments, foresight.scouts or environments, strict=True
        )
    ]
    for pair in living:
        pair.begin(first_seed + pair.number)
    on_begin([pair.played for pair in living])
    repeats = bool(foresight.scouts)
    while living:
        depth = foresight.depth(np.array([pair.number for pair in living])) if repeats else 1
        if depth > 1 and not all(pair.catch_up() for pair in living):
            repeats, depth = _end(foresight, environments), 1
        observations, rows, predicted = _chains(foresight.predict, living, depth)
        actions = act(observations, rows)
        agreed = np.equal(actions, predicted).tolist()
        taken = actions.tolist()
        counted, right, rewards = 0, 0, list[float]()
        for pair in living:
            count = pair.accept(taken, agreed)
            counted += count
            right += sum(agreed[row] for row in pair.rows[:count])
            rewards += pair.rewards
            if pair.is_over:
                on_episode(Episode.of(pair.played))
        if repeats and not all(pair.repeats for pair in living):
            repeats = _end(foresight, environments)
        living = [pair for pair in living if not pair.is_over]
        foresight.note(counted, right)
        on_rewards(rewards)


def _end(foresight: Foresight, environments: list[Environment]) -> bool:
    """Say that nothing is run ahead from now on; False."""
    name = environment_name(environments[0])
    foresight.say(f"{name} does not repeat itself: steps are no longer measured ahead")
    return False


def _chains(predict: Act, living: Sequence[_Pair], depth: int) -> tuple[FloatArray, Rows, IntArray]:
    """What the next job measures: observations (B, features), rows, and predicted actions (B,).

    The scouts walk along the predictions, at most `depth` - 1 decisions: what the last action leads
    to is not measured.
    """
    parts: list[tuple[FloatArray, IntArray, IntArray, IntArray]] = []
    walking = [(pair, pair.observation) for pair in living]
    first = 0
    for pair in living:
        pair.rows, pair.foreseen = [], []
    for further in reversed(range(depth)):
        observations = np.stack([seen for _, seen in walking]).astype(np.float64)
        numbers = np.array([pair.number for pair, _ in walking])
        decisions = np.array([len(pair.actions) + len(pair.foreseen) for pair, _ in walking])
        predicted = predict(observations, Rows(numbers, decisions))
        parts.append((observations, numbers, decisions, predicted))
        for row, (pair, _) in enumerate(walking, first):
            pair.rows.append(row)
        first += len(walking)
        if further:
            taken = zip(walking, predicted.tolist(), strict=True)
            following = [(pair, pair.walk(action)) for (pair, _), action in taken]
            walking = [(pair, seen) for pair, seen in following if seen is not None]
        if not walking:
            break
    observations, numbers, decisions, predicted = map(np.concatenate, zip(*parts, strict=True))
    return observations, Rows(numbers, decisions), predicted


class _Pair:
    """An episode and its scout.

    `actions` are the decisions that counted, `answers` what the reset and each of them led to, and
    `observation` (features,) what the episode decides by next. `rows` are those of its chain in the
    job at hand, `foreseen` what their predicted actions led the scout to, `rewards` what those that
    counted earned.
    """

    __slots__ = (
        *("_is_lost", "_walked", "actions", "answers", "foreseen", "is_over", "number"),
        *("observation", "played", "repeats", "rewards", "rows", "scout"),
    )

    def __init__(self, number: int, played: Stepper, scout: Stepper):
        self.number, self.played, self.scout = number, played, scout
        self._walked: int | None = None
        """How many of the actions the scout has taken; None where it took others."""
        self.actions: list[int] = []
        self.answers: list[bytes] = []
        self.rows: list[int] = []
        self.foreseen: list[bytes] = []
        self.rewards: list[float] = []
        self._is_lost, self.is_over, self.repeats = False, False, True

    def begin(self, seed: int) -> None:
        """Reset the episode."""
        self.observation: NDArray[Any] = self.played.reset(seed)
        self.answers = [self.observation.tobytes()]

    def catch_up(self) -> bool:
        """Lead the scout to where the episode is; False where it sees anything else on its way.

        Where it fails it is lost, and a job measures one decision of the episode.
        """
        if self._is_lost:
            return True
        try:
            if self._walked is None:
                if self.scout.reset(self.played.seed).tobytes() != self.answers[0]:
                    return False
                self._walked = 0
            for action in self.actions[self._walked :]:
                self._walked += 1
                if _answer(*self._scouted(action)) != self.answers[self._walked]:
                    return False
        except EnvironmentStepError:
            self._is_lost = True
        return True

    def walk(self, action: int) -> NDArray[Any] | None:
        """Let the scout take a predicted action; what it observes then, None where its chain ends.

        It ends with the episode, or where the scout fails.
        """
        if self._is_lost:
            return None
        try:
            observation, reward, terminated, truncated = self._scouted(action)
        except EnvironmentStepError:
            self._walked = None
            return None
        self.foreseen.append(_answer(observation, reward, terminated, truncated))
        return None if self.scout.has_ended else observation

    def _scouted(self, action: int) -> tuple[NDArray[Any], float, bool, bool]:
        answer = self.scout.step(action)
        check_finite([self.scout], answer[0][None])
        return answer

    def accept(self, actions: Sequence[int], agreed: Sequence[bool]) -> int:
        """Take the measured actions, as far as they count; how many did.

        `actions` and `agreed`, whether they are the predicted ones, are those of all rows.
        """
        self.rewards = []
        is_foreseen = True
        for k, row in enumerate(self.rows):
            observation, reward, terminated, truncated = self.played.step(actions[row])
            check_finite([self.played], observation[None])
            self.observation = observation
            self.actions.append(actions[row])
            self.answers.append(_answer(observation, reward, terminated, truncated))
            self.rewards.append(reward)
            self.is_over = self.played.has_ended
            if k < len(self.foreseen):
                is_foreseen = agreed[row]
                self.repeats = not is_foreseen or self.answers[-1] == self.foreseen[k]
            if self.is_over or not agreed[row] or not self.repeats:
                break
        kept = is_foreseen and len(self.rewards) >= len(self.foreseen)
        if self._walked is not None:
            self._walked = self._walked + len(self.foreseen) if kept else None
        return len(self.rewards)


def _answer(observation: NDArray[Any], reward: float, terminated: bool, truncated: bool) -> bytes:
    """What an action led to, to be compared bit for bit."""
    return observation.tobytes() + struct.pack("<d??", reward, terminated, truncated)


def check_repeatable(environment: Environment) -> None:
    """Nothing, if no wrapper of an environment normalises by statistics of what it has seen so far.

    A scout that is rebuilt would have seen other things than the episode.

    Raises:
        OptionError: one does, or the environment itself.
    """
    layer: Any = environment
    while layer is not None:
        for value in vars(layer).values():
            if isinstance(value, RunningMeanStd):
                raise OptionError(
                    f"{environment_name(environment)} keeps running statistics "
                    f"({type(layer).__name__}): its steps cannot be measured ahead.",
                    "Take speculate 1.",
                )
        layer = vars(layer).get("env")
