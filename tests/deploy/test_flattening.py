"""Numeric observations become vectors, as by gymnasium's own `flatten`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from qcompile.deploy.environments import features_and_actions, make_environments
from qcompile.deploy.lockstep import Episode, lockstep
from qcompile.deploy.stepping import Stepper
from qcompile.errors import EnvironmentMismatchError, EnvironmentStepError
from qcompile.limits import MAX_FEATURES


class Seen(gymnasium.Env[Any, Any]):
    """Observes `values` in turn, from a space of any kind."""

    action_space = spaces.Discrete(2)

    def __init__(self, space: Any, values: Any):
        self.observation_space, self.values = space, values

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.count = 0
        return self.values[0], {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.count += 1
        over = self.count == len(self.values) - 1
        return self.values[self.count], 1.0, over, False, {}


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    gymnasium.register("Seen-v0", Seen, disable_env_checker=True)
    yield
    del gymnasium.registry["Seen-v0"]


def made(space: Any, *values: Any, bits: bool = False) -> gymnasium.Env[Any, Any]:
    arguments = {"space": space, "values": values}
    (environment,) = make_environments("Seen-v0", 1, arguments=arguments, bits=bits)
    return environment


def observed(space: Any, *values: Any, bits: bool = False) -> list[list[float]]:
    """The policy's observations of these values; the last one ends the episode."""
    found: list[list[float]] = []
    episodes: list[Episode] = []

    def act(observations: Any, rows: Any) -> Any:
        found.append(observations[0].tolist())
        return np.zeros(1, int)

    environment = made(space, *values, values[-1], bits=bits)
    lockstep(act, [environment], 0, on_episode=episodes.append)
    assert episodes[0].length == len(values)
    return found


BOX = spaces.Box(-np.inf, np.inf, (2, 2), np.float32)
EYE = np.eye(2, dtype=np.float32)
IMAGE = spaces.Box(0, 255, (2, 1, 3), np.uint8)


@pytest.mark.parametrize(
    ("space", "value", "expected"),
    [
        (spaces.Discrete(4), 2, [0, 0, 1, 0]),
        (spaces.Discrete(3, start=-1), -1, [1, 0, 0]),
        (spaces.Discrete(3, start=7), np.int64(9), [0, 0, 1]),
        (spaces.MultiDiscrete([2, 3]), np.array([1, 0]), [0, 1, 1, 0, 0]),
        (spaces.MultiBinary(3), np.array([1, 0, 1], np.int8), [1, 0, 1]),
        (BOX, np.array([[1, 2], [3, 4]], np.float32), [1, 2, 3, 4]),
        (spaces.Box(-1, 1, (), np.float32), np.float32(0.5), [0.5]),
        (IMAGE, np.arange(6, dtype=np.uint8).reshape(2, 1, 3), [0, 1, 2, 3, 4, 5]),
        (spaces.Tuple([spaces.Discrete(2), BOX]), (1, EYE), [0, 1, 1, 0, 0, 1]),
        (
            spaces.Dict({"b": spaces.Discrete(2), "a": spaces.Dict({"c": spaces.Discrete(2)})}),
            {"a": {"c": 1}, "b": 0},
            [0, 1, 1, 0],
        ),
    ],
    ids=str,
)
def test_observations_are_flattened(space: Any, value: Any, expected: list[float]) -> None:
    assert observed(space, value) == [expected]
    assert gymnasium.spaces.flatten(space, value).tolist() == expected, "as gymnasium says"
    assert features_and_actions(made(space, value)) == (len(expected), 2)


def test_a_vector_is_not_wrapped() -> None:
    plain = make_environments("CartPole-v1", 1)[0]
    assert str(plain) == str(gymnasium.make("CartPole-v1", disable_env_checker=True))


def test_a_number_is_left_where_its_bits_are_read() -> None:
    space = spaces.Discrete(9, start=3)
    assert observed(space, 3, np.int64(11), bits=True) == [[0], [8]]
    assert observed(BOX, np.zeros((2, 2), np.float32), bits=True) == [[0, 0, 0, 0]]


def test_whole_numbers_of_another_type_are_those_of_the_space() -> None:
    assert observed(IMAGE, np.full((2, 1, 3), 255)) == [[255] * 6]


@pytest.mark.parametrize(
    ("space", "words"),
    [
        (spaces.Text(4), "Seen-v0 observes a Text."),
        (spaces.Sequence(spaces.Discrete(2)), "Seen-v0 observes a Sequence."),
        (
            spaces.Dict({"a": spaces.Tuple([spaces.Discrete(2), spaces.Text(4)])}),
            "Seen-v0 observes a Text in its part a.1.",
        ),
        (spaces.Graph(BOX, None), "Seen-v0 observes a Graph."),
        (spaces.Discrete(10**12), "Seen-v0 observes 1,000,000,000,000 numbers in total"),
        (spaces.Box(0, 1, (MAX_FEATURES + 1, 1)), f"observes {MAX_FEATURES + 1:,} numbers"),
        (spaces.Box(0, 1, (3, 0)), "Seen-v0 observes 0 numbers"),
        (None, "Seen-v0 has no observation_space."),
    ],
    ids=lambda value: str(value)[:30],
)
def test_what_is_not_made_of_few_numbers_is_refused(space: Any, words: str) -> None:
    with pytest.raises(EnvironmentMismatchError) as error:
        made(space, None)
    assert words in str(error.value)
    assert space is None or "a module of your own" in str(error.value)


def test_a_vector_of_nothing_is_refused() -> None:
    environment = Seen(spaces.Box(0, 1, (0,)), None)
    with pytest.raises(EnvironmentMismatchError, match="A policy needs at least one feature"):
        features_and_actions(environment)


@pytest.mark.parametrize(
    ("space", "value", "words"),
    [
        (spaces.Discrete(4), -1, "the observation is -1, which is not in Discrete(4)"),
        (spaces.Discrete(4), None, "the observation is None, which is not in Discrete(4)"),
        (spaces.MultiDiscrete([2, 3]), np.array([2, 0]), "the observation is [2 0], which is not"),
        (BOX, np.zeros((4, 1), np.float32), "has shape (4, 1), its space declares (2, 2)"),
        (IMAGE, np.full((2, 1, 3), 0.5), "numbers of type float64, its space declares uint8"),
        (IMAGE, np.full((2, 1, 3), 300), "a number that its space's type uint8 cannot hold"),
        (IMAGE, np.full((2, 1, 3), -1), "a number that its space's type uint8 cannot hold"),
        (BOX, np.full((2, 2), 1j), "numbers of type complex128, its space declares float32"),
        (BOX, np.full((2, 2), "1"), "numbers of type <U1, its space declares float32"),
        (spaces.Dict({"a": BOX}), {"b": 1}, "the observation has no part a"),
        (spaces.Dict({"a": spaces.Discrete(2)}), {"a": 5}, "part a is 5, which is not in Discrete"),
        (BOX, np.full((2, 2), np.nan, np.float32), "feature 0 of the observation is nan"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_an_observation_that_is_not_of_its_space_is_told(
    space: Any, value: Any, words: str
) -> None:
    with pytest.raises(EnvironmentStepError) as error:
        observed(space, value)
    assert words in str(error.value)
    assert str(error.value).startswith("Seen-v0, episode of seed 0, its reset: ")


@pytest.mark.parametrize("start", [0, 3])
def test_a_number_is_held_to_its_space_too(start: int) -> None:
    with pytest.raises(EnvironmentStepError, match="which is not in Discrete"):
        observed(spaces.Discrete(3, start=start), start + 3, bits=True)


def test_a_flattened_environment_is_filmed() -> None:
    frames: list[Any] = []
    lake = make_environments("FrozenLake-v1", 1, film=True)
    act: Callable[..., Any] = lambda observations, rows: np.ones(1, int)  # noqa: E731

    def film(steppers: Sequence[Stepper]) -> None:
        steppers[0].on_step = lambda: frames.append(lake[0].render())

    lockstep(act, lake, 0, max_steps=2, on_begin=film)
    assert frames
    assert {frame.shape for frame in frames} == {(256, 256, 3)}
