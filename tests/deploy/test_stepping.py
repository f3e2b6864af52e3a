"""Stepping environments: valid answers, refusals and their messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete

from qcompile.deploy.environments import make_environments
from qcompile.deploy.lockstep import Episode, lockstep
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper
from qcompile.errors import EnvironmentMismatchError, EnvironmentStepError, TrainingError
from qcompile.rl.ppo import Trainer
from qcompile.rl.rollout import Collector
from qcompile.rl.settings import Settings

GOOD = np.zeros(2, np.float32)


class Scripted(gymnasium.Env[Any, Any]):
    """Returns given answers to resets and steps, and records the actions."""

    def __init__(
        self,
        answer: Callable[[int], Any],
        reset: Any = (GOOD, {}),
        start: int = 0,
        dtype: Any = np.float32,
        render_mode: str | None = None,
    ):
        self.observation_space = Box(0, 100, (2,), dtype)
        self.action_space = Discrete(2, start=start)
        self.render_mode = render_mode
        self.answer, self.first = answer, reset
        self.sent: list[Any] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.steps = 0
        return self.first

    def step(self, action: Any) -> Any:
        self.sent.append(action)
        self.steps += 1
        return self.answer(self.steps)


@pytest.fixture
def registered() -> Iterator[Callable[..., str]]:
    """The name of an environment with these answers, with gymnasium's usual wrappers."""

    def register(answer: Callable[[int], Any], **settings: Any) -> str:
        gymnasium.register(
            "Scripted-v0",
            lambda **kwargs: Scripted(answer, **settings, **kwargs),
            max_episode_steps=50,
        )
        return "Scripted-v0"

    yield register
    gymnasium.registry.pop("Scripted-v0", None)


def usual(step: int) -> Any:
    return GOOD, 1.0, step == 4, False, {}


def first(observations: np.ndarray, rows: Rows | None = None) -> np.ndarray:
    return np.zeros(len(observations), dtype=int)


def refused(name: str) -> str:
    """The message of both a run and a training of three episodes, which must be the same."""
    said = []
    for use in (
        lambda: lockstep(first, make_environments(name, 3), 7),
        lambda: Collector(name, 3, np.random.SeedSequence(0)).collect(first, 10),
    ):
        with pytest.raises(EnvironmentStepError) as caught:
            use()
        words = str(caught.value)
        assert len(words) <= 400
        said.append(words)
    run, training = said
    assert run.startswith("Scripted-v0, episode of seed 7, ")
    assert run.partition(": ")[2] == training.partition(": ")[2]
    return run.partition("seed 7, ")[2]


@pytest.mark.parametrize("start", [-3, 0, 1, 5])
def test_actions_have_the_numbers_of_the_environment(
    registered: Callable[..., str], start: int
) -> None:
    """A policy's action 0 is the first of Discrete(2, start=k): k. Run and training alike."""
    name = registered(usual, start=start)
    choose = [0, 1, 1, 0]
    (environment,) = make_environments(name, 1)
    turns = iter(choose)
    lockstep(lambda seen, rows: np.array([next(turns)]), [environment], 0)
    assert environment.unwrapped.sent == [start + action for action in choose]  # type: ignore[attr-defined]
    collector, turns = Collector(name, 1, np.random.SeedSequence(0)), iter(choose)
    rollout = collector.collect(lambda seen: np.array([next(turns)]), None)
    (stepper,) = collector._steppers
    assert stepper.environment.unwrapped.sent == [start + action for action in choose]  # type: ignore[attr-defined]
    assert rollout.actions[:, 0].tolist() == choose
    again = Collector(name, 1, np.random.SeedSequence(9))
    turns = iter(choose)
    collector.collect(lambda seen: np.array([next(turns)]), 2)
    again.restore(collector.state())
    assert again._steppers[0].environment.unwrapped.sent == [start, start + 1]  # type: ignore[attr-defined]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_observation_that_is_not_finite_is_told(
    registered: Callable[..., str], value: float
) -> None:
    def answer(step: int) -> Any:
        seen = np.array([0.5, value if step == 3 else 0.25], np.float32)
        return seen, 1.0, False, False, {}

    assert refused(registered(answer)) == (
        f"step 3: feature 1 of the observation is {value}.\n  Observations must be finite."
    )


def test_what_float32_cannot_hold_is_told(registered: Callable[..., str]) -> None:
    """1e39 is beyond float32, which the environment declares."""
    name = registered(lambda step: (np.array([1e39, 0.0]), 1.0, False, False, {}))
    assert "step 1: feature 0 of the observation is inf." in refused(name)


def test_the_first_observation_is_checked_too(registered: Callable[..., str]) -> None:
    name = registered(usual, reset=(np.array([0, np.nan], np.float32), {}))
    assert refused(name).startswith("its reset: feature 1 of the observation is nan.")


def test_the_last_observation_of_an_episode_is_checked_too(registered: Callable[..., str]) -> None:
    name = registered(lambda step: (np.full(2, np.nan, np.float32), 1.0, step == 2, False, {}))
    assert refused(name).startswith("step 1: feature 0")


REWARDS: dict[str, tuple[Any, str]] = {
    "nan": (float("nan"), "the reward is nan."),
    "infinite": (-np.inf, "the reward is -inf."),
    "numpy's nan": (np.float32("nan"), "the reward is nan."),
    "None": (None, "the reward is None."),
    "a text": ("1.0", "the reward is a str."),
    "a list": ([1.0], "the reward is a list."),
    "an array": (np.ones(1), "the reward is an array of shape (1,) and type float64."),
    "complex": (1 + 2j, "the reward is a complex."),
}


@pytest.mark.parametrize(("reward", "words"), REWARDS.values(), ids=REWARDS)
def test_rewards_that_are_no_finite_numbers(
    registered: Callable[..., str], reward: Any, words: str
) -> None:
    name = registered(lambda step: (GOOD, reward if step == 2 else 1.0, False, False, {}))
    assert refused(name).startswith(f"step 2: {words}\n  ")


@pytest.mark.parametrize("reward", [2, True, np.float32(2), np.int8(2), np.array(2.0), np.bool_(1)])
def test_rewards_that_are_numbers(registered: Callable[..., str], reward: Any) -> None:
    name, found = registered(lambda step: (GOOD, reward, step == 3, False, {})), []
    lockstep(first, make_environments(name, 1), 0, on_episode=found.append)
    assert found == [Episode(0, 3 * float(reward), 3)]
    assert type(found[0].reward) is float


def test_rewards_whose_sum_is_too_large(registered: Callable[..., str]) -> None:
    name = registered(lambda step: (GOOD, 6e149, False, False, {}))
    assert "step 2: the reward is 6e+149.\n  Rewards and their sum" in refused(name)


OBSERVATIONS: dict[str, tuple[Any, str]] = {
    "None": (None, "None"),
    "one number": (0.5, "a float"),
    "one feature": (np.zeros(1, np.float32), "an array of shape (1,) and type float32"),
    "a matrix": (np.zeros((1, 2), np.float32), "an array of shape (1, 2) and type float32"),
    "objects": (np.array([1.0, None]), "an array of shape (2,) and type object"),
    "texts": (["1", "2"], "a list"),
    "ragged": ([[1.0], [1.0, 2.0]], "a list"),
    "complex": (np.zeros(2, complex), "an array of shape (2,) and type complex128"),
    "a dictionary": ({"x": 1.0}, "a dict"),
}


@pytest.mark.parametrize(("seen", "words"), OBSERVATIONS.values(), ids=OBSERVATIONS)
def test_observations_other_than_declared(
    registered: Callable[..., str], seen: Any, words: str
) -> None:
    needed = "\n  Its space declares numbers of shape (2,)."
    name = registered(lambda step: (seen, 1.0, False, False, {}))
    assert refused(name) == f"step 1: the observation is {words}.{needed}"
    gymnasium.registry.pop(name)
    assert refused(registered(usual, reset=(seen, {}))).startswith(
        f"its reset: the observation is {words}."
    )


ANSWERS: dict[str, tuple[Any, str]] = {
    "the API of gym": ((GOOD, 1.0, False, {}), "step returned"),
    "three values": ((GOOD, 1.0, False), "step returned"),
    "None": (None, "step returned"),
    "flags": ((GOOD, 1.0, None, False, {}), "terminated and truncated must be true or false"),
    "an array of flags": (
        (GOOD, 1.0, np.array([True, False]), False, {}),
        "terminated and truncated must be true or false",
    ),
}


@pytest.mark.parametrize(("answer", "words"), ANSWERS.values(), ids=ANSWERS)
@pytest.mark.parametrize("limited", [True, False])
def test_steps_of_another_form(
    registered: Callable[..., str], answer: Any, words: str, limited: bool
) -> None:
    """With gymnasium's time limit, which takes the answer apart first, and without."""
    if limited:
        assert refused(registered(lambda step: answer)).startswith(f"step 1: {words}")
        return
    stepper = Stepper(Scripted(lambda step: answer))
    stepper.reset(3)
    with pytest.raises(EnvironmentStepError, match="episode of seed 3, step 1: "):
        stepper.step(0)


def test_a_reset_that_gives_the_observation_alone(registered: Callable[..., str]) -> None:
    """Its first feature would be taken for the observation."""
    assert refused(registered(usual, reset=GOOD)) == (
        "its reset: reset returned an array of shape (2,) and type float32.\n"
        "  It must return (observation, info)."
    )


def test_an_environment_that_fails(registered: Callable[..., str]) -> None:
    def answer(step: int) -> Any:
        raise ZeroDivisionError("the cart left the\ntrack")

    assert refused(registered(answer)) == "step 1: the environment failed: the cart left the"


def test_ctrl_c_in_a_step_is_no_failure(registered: Callable[..., str]) -> None:
    def answer(step: int) -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lockstep(first, make_environments(registered(answer), 1), 0)


def test_an_environment_that_cannot_be_made() -> None:
    def make(**_: Any) -> Any:
        raise RuntimeError("no simulator here")

    gymnasium.register("Unmakeable-v0", make)
    try:
        with pytest.raises(
            EnvironmentMismatchError, match=r"cannot be made\.\n  no simulator here"
        ):
            make_environments("Unmakeable-v0", 1)
    finally:
        del gymnasium.registry["Unmakeable-v0"]


FINE = 1 + 2.0**-40
"""A number that float32 rounds to 1."""


@pytest.mark.parametrize(
    ("declared", "seen"), [(np.float64, FINE), (np.float32, 1.0), (np.int64, 1.0), (np.uint8, 1.0)]
)
def test_training_and_run_see_the_same_numbers(
    registered: Callable[..., str], declared: Any, seen: float
) -> None:
    """float32 is the precision of an environment that declares it; float64 is kept."""
    value = np.array([FINE, 0.0]) if np.dtype(declared).kind == "f" else np.array([1, 0], declared)
    name = registered(lambda step: (value, 1.0, step == 3, False, {}), dtype=declared)
    found = []
    lockstep(lambda o, rows: (found.append(o[0, 0]), first(o))[1], make_environments(name, 1), 0)
    learned = []
    Collector(name, 1, np.random.SeedSequence(0)).collect(
        lambda o: (learned.append(float(o[0, 0])), first(o))[1], None
    )
    assert found[1:] == learned[1:] == [seen] * 2


@pytest.mark.parametrize("model", ["svqc", "surrogate", "mvqc", "fcn", "cnn"])
def test_every_model_learns_from_double_precision(
    registered: Callable[..., str], model: str
) -> None:
    hidden = {"hidden": (4,)} if model in ("fcn", "cnn") else {}
    name = registered(usual, dtype=np.float64, reset=(np.zeros(2), {}))
    settings = Settings(model=model, horizon=6, environments=2, steps=24, **hidden)  # type: ignore[arg-type]
    result = Trainer(name, settings, 0).train()
    assert result.steps == 24
    assert all(numbers.isfinite().all() for numbers in result.actor.parameters())


def test_an_encoding_in_training_has_the_precision_of_the_policy(
    registered: Callable[..., str],
) -> None:
    """1e9 and 1e9 + 1 are one number in float32; x = arctan(u - 1e9) would be, too."""
    name = registered(usual, dtype=np.float64)
    trainer = Trainer(name, Settings(horizon=6, steps=12, scales=(1e-9,)), 0)
    seen = torch.tensor([[1e9, 0.0], [1e9 + 60, 0.0]], dtype=torch.float64)
    policy = trainer.policy()
    assert policy is not None
    x = trainer.actor.inputs(seen).detach().numpy()  # type: ignore[operator]
    np.testing.assert_allclose(x, policy.encode(seen.numpy()), atol=1e-7)


def test_a_training_keeps_what_it_had_learned(registered: Callable[..., str]) -> None:
    """The environment breaks in the third rollout: the policy has two updates."""
    settings = Settings(episodes=9, actor_lr=0.05)
    count = 0

    def answer(step: int) -> Any:
        nonlocal count
        count += 1
        seen = np.full(2, np.nan if count == 10 else step / 10, np.float32)
        return seen, float(step), step == 4, False, {}

    name, updates = registered(answer), []
    trainer = Trainer(name, settings, 0)
    with pytest.raises(EnvironmentStepError, match="step 2: feature 0 of the observation is nan"):
        trainer.train(on_update=lambda: updates.append(trainer.policy()))
    result = trainer.result()
    assert len(updates) == len(result.episodes) == 2
    assert result.policy is not None
    assert updates[1] is not None
    np.testing.assert_array_equal(result.policy.theta, updates[1].theta)
    np.testing.assert_array_equal(result.policy.weights, updates[1].weights)


def test_learning_that_diverges_keeps_the_last_good_numbers(
    registered: Callable[..., str],
) -> None:
    """Single precision, in which values are learned, does not hold 1e39."""
    pays = iter([1.0] * 8 + [1e39] * 4)
    name = registered(lambda step: (GOOD, next(pays), step == 4, False, {}))
    trainer, good = Trainer(name, Settings(episodes=9), 0), []
    with pytest.raises(
        TrainingError, match=r"^Learning diverged after 3 episodes: .*\n  Try smaller"
    ):
        trainer.train(on_update=lambda: good.append(trainer.policy()))
    result = trainer.result()
    assert len(good) == 2
    assert result.policy is not None
    np.testing.assert_array_equal(result.policy.weights, good[1].weights)
    for model in (trainer.actor, trainer._critic):
        assert all(torch.isfinite(p).all() for p in model.parameters())


def test_a_run_names_the_episode(
    registered: Callable[..., str], stubborn: Callable[..., Any], deploy: Callable[..., Any]
) -> None:
    name = registered(lambda step: (GOOD, np.nan if step == 2 else 1.0, False, False, {}))
    with pytest.raises(EnvironmentStepError, match=r"^Scripted-v0, episode of seed 4, step 2: the"):
        play(deploy(stubborn(name, 2, 2), seed=4), 3)


def test_a_step_that_gives_nothing_is_told(registered: Callable[..., str]) -> None:
    said = refused(registered(lambda step: None))
    assert said.startswith("step 1: step returned a wrong number of values.\n")


@pytest.mark.parametrize("reward", [1e308, -2e150])
def test_a_reward_whose_square_overflows_is_told(
    registered: Callable[..., str], reward: float
) -> None:
    said = refused(registered(lambda step: (GOOD, reward, False, False, {})))
    assert said.startswith(f"step 1: the reward is {reward}.\n")
    assert said.endswith("1e+150.")
