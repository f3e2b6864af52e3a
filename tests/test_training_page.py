"""docs/howto/training.md says what trainings do: its names, its tables, its files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sessions import DOCS, words_of

from qcompile.cli.assignments import Assignment
from qcompile.policy import Policy, load_policy
from qcompile.rl.presets import settings_for
from qcompile.rl.settings import SETTING_NAMES, Settings

PAGE = (DOCS / "howto/training.md").read_text()
PRESETS = ("paper", "tuned", "hardware")


def rows(header: str) -> list[list[str]]:
    """The cells of the table that begins with this header, without backquotes."""
    _, _, below = PAGE.partition(f"| {header} |")
    lines = below.partition("\n\n")[0].splitlines()[2:]
    return [[cell.strip().strip("`") for cell in line.split("|")[1:-1]] for line in lines]


def value(name: str, cell: str) -> Any:
    """The value of a setting from its cell, typed as `-s NAME=CELL`."""
    _, found = Assignment().convert(f"{name}={cell}", None, None)
    return getattr(Settings(**{name: found}), name)


def test_every_setting_is_in_the_table() -> None:
    assert {row[0] for row in rows("setting")} == {*SETTING_NAMES} - {"model", "layout"}


@pytest.mark.parametrize("row", rows("setting"), ids=lambda row: row[0])
def test_a_setting_has_the_default_and_the_values_of_the_presets(row: list[str]) -> None:
    name, default, *cells, meaning = row
    assert value(name, default) == getattr(Settings(), name)
    assert "" not in (default, meaning)
    for preset, cell in zip(PRESETS, cells, strict=True):
        expected = getattr(settings_for(preset, "Any-v0"), name)
        assert value(name, cell or default) == expected, preset
        assert not cell or expected != value(name, default)


def test_horizons_of_the_text() -> None:
    assert "`horizon`, for instance, is 8 for Acrobot and `none` for CartPole" in " ".join(
        PAGE.split()
    )
    found = [settings_for("tuned", name).horizon for name in ("Acrobot-v1", "CartPole-v1")]
    assert found == [8, None]


@pytest.fixture
def trained(qcompile: Callable[..., Any], tmp_path: Path) -> Callable[..., tuple[int, int]]:
    """The circuits and the parameters of a short training for Acrobot with these words."""

    def counts(*words: str) -> tuple[int, int]:
        policy = tmp_path / "p.json"
        common = ("train", "Acrobot-v1", "--steps", 1, "--out", policy, "--json")
        answer = qcompile(*common, *words)
        assert answer.code == 0, answer.err
        loaded = load_policy(policy)
        assert isinstance(loaded, Policy)
        return len(loaded.program.circuits), answer.json()["parameters"]

    return counts


@pytest.mark.parametrize("row", rows("`--layout`"), ids=lambda row: row[0])
def test_circuits_and_parameters_of_a_layout(
    trained: Callable[..., tuple[int, int]], row: list[str]
) -> None:
    layout, _, circuits, parameters = row
    assert trained("--layout", layout) == (int(circuits), int(parameters))


def test_parameters_with_one_scale(trained: Callable[..., tuple[int, int]]) -> None:
    found = re.search(r"With `-s (\S+)` it has (\d+) circuits and (\d+) parameters", PAGE)
    assert found is not None
    assert trained("-s", found[1]) == (int(found[2]), int(found[3]))


def test_no_command_stumbles_over_the_file_of_another() -> None:
    """Only a training that is resumed writes its policy again."""
    lines = re.findall(r"^qcompile train .*--out .*", PAGE, re.MULTILINE)
    fresh = [words_of(line) for line in lines if "--resume" not in line]
    files = [words[words.index("--out") + 1] for words in fresh]
    assert len(files) > 5
    assert len(files) == len({*files})
