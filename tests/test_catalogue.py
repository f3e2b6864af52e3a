"""Suggestions for unknown names."""

from __future__ import annotations

import gymnasium
import pytest

from qcompile.catalogue import nearest
from qcompile.device import device_names
from qcompile.rl.settings import SETTING_NAMES, nearest_setting

ENVIRONMENTS = ["CartPole-v1", "Acrobot-v1", *gymnasium.registry]
GATES = ["id", "x", "y", "z", "h", "s", "sdg", "t", "tdg", "sx", "sxdg", "rx", "ry", "rz", "p"]


@pytest.mark.parametrize(
    ("name", "known", "words"),
    [
        ("gama", SETTING_NAMES, "gamma"),
        ("entropi", SETTING_NAMES, "entropy"),
        ("ENTROPY", SETTING_NAMES, "entropy"),
        ("actorlr", SETTING_NAMES, "actor_lr"),
        ("lima", device_names(), "ibm_lima"),
        ("FakeLima", device_names(), "fake_lima"),
        ("ibm_lime", device_names(), "ibm_lima"),
        ("CartPol-v1", ENVIRONMENTS, "CartPole-v1"),
        ("LunarLander-v2", ["LunarLander-v3", "LunarLanderContinuous-v3"], "LunarLander-v3"),
        ("toronto", device_names(), "ibm_toronto or fake_toronto"),
        ("sxgd", GATES, "sxdg"),
        ("RX", GATES, "rx"),
    ],
)
def test_a_slip_of_the_pen_is_put_right(name: str, known: list[str], words: str) -> None:
    assert nearest(name, known) == f"Did you mean {words}?"


@pytest.mark.parametrize("name", ["nope", "foo", "", "learning_rate", "e" * 10**6])
def test_without_similar_names_the_first_dozen_are_listed(name: str) -> None:
    words = nearest(name, SETTING_NAMES)
    assert words == f"Known: {', '.join(SETTING_NAMES[:12])}, ...."


def test_all_settings_are_listed() -> None:
    assert nearest_setting("nothing") == f"Known: {', '.join(SETTING_NAMES)}."
    assert nearest_setting("clp") == "Did you mean clip?"


@pytest.mark.parametrize("name", ["cartpole-v1", "xyz"])
def test_no_name_stands_twice(name: str) -> None:
    words = nearest(name, ENVIRONMENTS).rstrip(".?").replace("Did you mean", "Known:")
    listed = words.removeprefix("Known: ").replace(" or ", ", ").split(", ")
    assert len(listed) == len(set(listed))
    assert "CartPole-v1" in listed


def test_where_nothing_is_known() -> None:
    assert nearest("x", []) == "None is known."
