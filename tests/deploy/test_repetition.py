"""Every episode draws from its own streams: it repeats alone, beside others and in copies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.lockstep import Act
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows, executions, packed
from qcompile.errors import CountsError
from qcompile.policy import load_policy

Actions = dict[int, list[int]]


class Kept:
    """The actions of each episode, by its number."""

    def __init__(self) -> None:
        self.actions: Actions = {}

    def act(self, act: Act, observations: np.ndarray, rows: Rows) -> np.ndarray:
        actions = act(observations, rows)
        for episode, action in zip(rows.episode.tolist(), actions.tolist(), strict=True):
            self.actions.setdefault(episode, []).append(action)
        return actions

    def rewards(self, rewards: list[float]) -> None:
        """Ignored here."""


def actions(episodes: int | list[int], backend: str = "ibm_toronto", **settings: Any) -> Actions:
    kept = Kept()
    chosen = {"shots": 32, "mitigation": "none", "max_steps": 40, **settings}
    play(Deployment(load_policy("cartpole"), backend, **chosen), episodes, recorder=kept)
    return kept.actions


def test_an_episode_alone_is_that_of_a_batch_of_a_hundred() -> None:
    together = actions(100)
    assert together[7] != together[8]
    assert actions([7]) == {7: together[7]}
    assert actions([3, 99]) == {3: together[3], 99: together[99]}
    assert actions(10) == {i: together[i] for i in range(10)}


def test_an_episode_of_split_rows_repeats_alone() -> None:
    together = actions(10, "fake_toronto", split=True)
    assert actions([6], "fake_toronto", split=True) == {6: together[6]}
    assert actions(10, "fake_toronto") != together


def test_side_by_side_changes_nothing_where_all_qubits_are_alike() -> None:
    """The qubits of the paper's ibm_toronto are, and its copies draw by episode."""
    assert actions(10, copies=4) == actions(10)
    assert actions([6], copies=4) == actions([6])


def test_an_episode_stays_on_its_own_qubits() -> None:
    """Those of fake_toronto differ: alone or not, episode 6 is measured in copy 2 of 4."""
    together = actions(10, "fake_toronto", copies=4, mitigation="readout")
    assert actions([6], "fake_toronto", copies=4, mitigation="readout") == {6: together[6]}


def test_other_seeds_and_episodes_draw_other_numbers() -> None:
    first, other = actions(3), actions(3, seed=1)
    assert first[0] != first[1]
    assert first[1] != other[0]  # the same reset, other draws


def test_a_deployment_by_hand_draws_anew_at_every_call() -> None:
    deployment = Deployment(load_policy("cartpole"), "ibm_lima", shots=1, mitigation="none")
    observations = np.zeros((200, 4))
    assert (deployment.act(observations) != deployment.act(observations)).any()


def test_places_by_hand() -> None:
    """Episodes 1, 4, 5, 8 and 9 on three copies: 1 and 4 share copy 1, 5 and 8 copy 2."""
    rows = Rows(np.array([1, 4, 5, 8, 9]), np.zeros(5, dtype=int))
    np.testing.assert_array_equal(packed(rows, 3), [[4, 0, 2], [-1, 1, 3]])
    assert executions(rows, 3) == 2
    assert executions(Rows.of(0), 3) == len(packed(Rows.of(0), 3)) == 0


def test_places_by_order_are_filled_up() -> None:
    """As in live runs of earlier versions."""
    rows = Rows(np.array([1, 4, 7]), np.zeros(3, dtype=int), np.arange(3))
    np.testing.assert_array_equal(packed(rows, 2), [[0, 1], [2, -1]])
    assert executions(rows, 2) == 2


class ByPlace(Kept):
    """Measures each row in the copy of its position, like live runs of earlier versions."""

    def act(self, act: Act, observations: np.ndarray, rows: Rows) -> np.ndarray:
        return super().act(act, observations, rows._replace(order=np.arange(len(observations))))


def test_executions_are_counted_as_rows_were_measured() -> None:
    """With copies filled in order, a step's executions are half the running episodes."""
    settings = {"shots": 10, "mitigation": "none", "copies": 2}
    deployment = Deployment(load_policy("cartpole_1q"), "fake_lima", **settings, seed=4)
    deployment.policy = replace(deployment.policy, weights=0.1 * deployment.policy.weights)
    run = play(deployment, 7, recorder=ByPlace())
    lengths = [episode.length for episode in run.episodes]
    living = [sum(length > step for length in lengths) for step in range(max(lengths))]
    assert len(set(lengths)) > 3
    rounds = deployment.executable.round_count
    assert run.load.executions == sum(-(-count // 2) for count in living) * rounds * 10


@pytest.mark.parametrize("episodes", [[], [-1, 2]])
def test_episodes_by_number_are_numbers_from_0(episodes: list[int]) -> None:
    with pytest.raises(CountsError, match="number of episodes cannot be"):
        actions(episodes)
