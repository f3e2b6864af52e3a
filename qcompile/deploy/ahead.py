"""Play episodes side by side, with several decisions of each measured in one job.

A simulated environment can be run ahead. The action of a decision is a function of the measurement
and of a uniform number that is known in advance, so it can be predicted without measuring: a
*scout*, a second copy of the episode's environment, follows the predicted actions, and everything
it observes is measured in one job. Then the episode takes the measured actions as long as they
equal the predicted ones. The first that differs still counts: it was measured on the episode's own
observation. The rest is discarded, and the scout is rebuilt by replaying the accepted actions.

Every decision that counts was measured on its own observation with its own shots, and decided by
its own uniform number; the prediction only chooses what else is measured. So the episodes have the
law of the ordinary closed loop, under conditions enforced here: the number of decisions in a job
depends only on earlier jobs; counts are used once, those of discarded rows never; rows of one
episode share no execution, and the place of a row follows from its episode and decision
(`deploy/rows.py`); the episode's own environment takes only accepted actions; and everything the
two environments of an episode return for the same actions is compared bit for bit. If it differs,
measurements beyond that point do not count, and from then on a job measures one decision of each
episode.

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
from qcompile.caller import option
from qcompile.deploy.environments import Environment, environment_name
from qcompile.deploy.lockstep import Act, Episode
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper, check_finite
from qcompile.errors import EnvironmentStepError, OptionError


@dataclass(frozen=True)
class Foresight:
    """How episodes are run ahead.

    `predict` maps observations and rows to actions, as `Act` does, at no cost; `scouts` are
    environments like those of the episodes, one for each, or none if they cannot be made. `depth`
    maps the numbers of the running episodes to the number of decisions of each in the next job;
    `note` is called after every job with the number of its rows that counted and the number of
    these that were predicted correctly. `say` gets a message if an environment does not repeat
    itself.
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
    """Play one episode in every environment, with the same law as `lockstep`.

    `act` gets the rows of a job, starting with the first decision of each running episode; of its
    actions (B,) only those that count are taken. `on_rewards` gets their rewards, episode by
    episode.

    Raises:
        EnvironmentStepError: an environment fails or returns unusable values; in a scout this only
            ends its chain.
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
    """Report that nothing is run ahead from now on; return False."""
    name = environment_name(environments[0])
    foresight.say(f"{name} does not repeat itself: steps are no longer measured ahead")
    return False


def _chains(predict: Act, living: Sequence[_Pair], depth: int) -> tuple[FloatArray, Rows, IntArray]:
    """The next job's observations (B, features), rows and predicted actions (B,).

    The scouts follow the predictions for at most `depth` - 1 decisions: the last action's outcome
    is not measured.
    """
    parts: list[tuple[FloatArray, IntArray, IntArray, IntArray]] = []
    active = [(pair, pair.observation) for pair in living]
    first = 0
    for pair in living:
        pair.rows, pair.foreseen = [], []
    for further in reversed(range(depth)):
        observations = np.stack([observation for _, observation in active]).astype(np.float64)
        numbers = np.array([pair.number for pair, _ in active])
        decisions = np.array([len(pair.actions) + len(pair.foreseen) for pair, _ in active])
        predicted = predict(observations, Rows(numbers, decisions))
        parts.append((observations, numbers, decisions, predicted))
        for row, (pair, _) in enumerate(active, first):
            pair.rows.append(row)
        first += len(active)
        if further:
            taken = zip(active, predicted.tolist(), strict=True)
            following = [(pair, pair.walk(action)) for (pair, _), action in taken]
            active = [(pair, observed) for pair, observed in following if observed is not None]
        if not active:
            break
    observations, numbers, decisions, predicted = map(np.concatenate, zip(*parts, strict=True))
    return observations, Rows(numbers, decisions), predicted


class _Pair:
    """An episode and its scout.

    `actions` are the decisions that counted, `answers` the environment's answers to the reset and
    to each of them, and `observation` (features,) is the input of the next decision. `rows` are the
    rows of its chain in the current job, `foreseen` the scout's answers to their predicted actions,
    `rewards` the rewards of those that counted.
    """

    __slots__ = (
        *("_is_lost", "_walked", "actions", "answers", "foreseen", "is_over", "number"),
        *("observation", "played", "repeats", "rewards", "rows", "scout"),
    )

    def __init__(self, number: int, played: Stepper, scout: Stepper):
        self.number, self.played, self.scout = number, played, scout
        self._walked: int | None = None
        """The number of actions the scout has taken; None if it took different ones."""
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
        """Bring the scout to the episode's state; False if it observes anything different.

        If it fails it is lost, and each job measures one decision of the episode.
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
        """Let the scout take a predicted action; return its observation, None if its chain ends.

        The chain ends with the episode, or if the scout fails.
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
        """Take the measured actions that count; return their number.

        `actions` has those of all rows, and `agreed` whether they equal the predicted ones.
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
        is_in_step = is_foreseen and len(self.rewards) >= len(self.foreseen)
        if self._walked is not None:
            self._walked = self._walked + len(self.foreseen) if is_in_step else None
        return len(self.rewards)


def _answer(observation: NDArray[Any], reward: float, terminated: bool, truncated: bool) -> bytes:
    """An environment's answer as bytes, for comparison bit for bit."""
    return observation.tobytes() + struct.pack("<d??", reward, terminated, truncated)


def check_repeatable(environment: Environment) -> None:
    """Check that no wrapper of an environment normalises by running statistics.

    A rebuilt scout would have statistics that differ from the episode's.

    Raises:
        OptionError: a wrapper does, or the environment itself.
    """
    layer: Any = environment
    while layer is not None:
        for value in vars(layer).values():
            if isinstance(value, RunningMeanStd):
                raise OptionError(
                    f"{environment_name(environment)} keeps running statistics "
                    f"({type(layer).__name__}): its steps cannot be measured ahead.",
                    f"Use {option('speculate')} 1.",
                )
        layer = vars(layer).get("env")
