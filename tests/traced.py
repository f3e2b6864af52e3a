"""Runs with every action that an environment took, and policies for environments of chance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np

from qcompile.deploy import play as playing
from qcompile.deploy.play import play
from qcompile.deploy.player import Player
from qcompile.deploy.result import Run
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel


def traced(player: Player, episodes: int | Sequence[int], **settings: Any) -> tuple[Run, Any]:
    """A run and, of each episode by the seed of its reset, the actions its environment took.

    They are noted at the environment that counts, below everything that plays.
    """
    actions: dict[int, list[int]] = {}

    def note(steppers: Sequence[Any]) -> None:
        for stepper in steppers:
            taken = actions.setdefault(stepper.seed, [])
            stepper._step = partial(_noted, taken, stepper._step)

    def watched(walk: Callable[..., None]) -> Callable[..., None]:
        def run(*words: Any, on_begin: Any, **others: Any) -> None:
            def begin(steppers: Sequence[Any]) -> None:
                note(steppers)
                on_begin(steppers)

            walk(*words, on_begin=begin, **others)

        return run

    with (
        patch.object(playing, "lockstep", watched(playing.lockstep)),
        patch.object(playing, "ahead", watched(playing.ahead)),
    ):
        run = play(player, episodes, **settings)
    return run, actions


def _noted(taken: list[int], step: Callable[[int], Any], action: int) -> Any:
    taken.append(int(action))
    return step(action)


def drawn_policy(
    environment: str, features: Sequence[int], actions: int, seed: int, **changes: Any
) -> Policy:
    """A policy of random numbers that reads these features; its probabilities are far from 0, 1."""
    rng, function = np.random.default_rng(seed), changes.pop("function", "arctan")
    program, _ = parallel(len(features), 1)
    return Policy(
        environment.split("-")[0].lower(),
        environment,
        Encoder(function, np.array(features), np.ones(len(features))),
        program,
        rng.uniform(-1, 1, len(features)),
        rng.uniform(-1.5, 1.5, (actions, len(features))),
        np.zeros(actions),
        **changes,
    )


def frozen_lake(**changes: Any) -> Policy:
    """Reads the four bits of its number; the lake is slippery, so every step is drawn."""
    return drawn_policy("FrozenLake-v1", range(4), 4, 1, function="bits", **changes)


def blackjack(**changes: Any) -> Policy:
    """Reads some of the flags of a hand; each card is drawn. It rather takes one more."""
    policy = drawn_policy("Blackjack-v1", [12, 14, 16, 18, 20, 33, 37, 43], 2, 2, **changes)
    return replace(policy, weights=3 * policy.weights, bias=np.array([-1.0, 1.0]))
