"""The shipped policies: the same numbers in both files, and cards that describe them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from qcompile.policy import Policy, load_policy

TRAINED = Path(__file__).parents[2] / "trained"
NAMES = sorted(path.stem for path in TRAINED.glob("*.pt"))
CARDS = (TRAINED / "README.md").read_text()


@pytest.mark.parametrize("name", NAMES)
def test_both_files_hold_the_same_numbers(name: str) -> None:
    one, other = (load_policy(TRAINED / f"{name}{suffix}") for suffix in (".pt", ".json"))
    assert isinstance(one, Policy)
    assert isinstance(other, Policy)
    assert one.program == other.program
    assert one.encoder.functions == other.encoder.functions
    for left, right in (
        (one.theta, other.theta),
        (one.weights, other.weights),
        (one.bias, other.bias),
        (one.encoder.scale, other.encoder.scale),
        (one.encoder.feature, other.encoder.feature),
    ):
        np.testing.assert_array_equal(left, right)
    assert (one.name, one.environment) == (other.name, other.environment)


@pytest.mark.parametrize("name", NAMES)
def test_the_card_names_seed_episodes_and_steps_of_the_file(name: str) -> None:
    (card,) = re.findall(rf"^## {name}\n(.*?)(?=^## |\Z)", CARDS, re.MULTILINE | re.DOTALL)
    metadata = load_policy(TRAINED / f"{name}.pt").metadata
    assert f"--seed {metadata['seed']} " in card
    assert f"{metadata['episodes']:,} episodes, {metadata['steps']:,} steps." in card
