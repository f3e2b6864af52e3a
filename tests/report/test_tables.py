"""Tables on terminals of any width, and where there is no terminal."""

from __future__ import annotations

import csv
import re
from typing import Any

import pytest

from qcompile.notebook import reward_form, reward_text
from qcompile.report.tables import difference_text, grid_table, print_grid, print_table

NUMBERS = ("17.7±4.4", "+139±157", "12 of 6 bad", "-123.4 to -110.2", "1.2e-04")
NAME = "folder/a-rather-long-name-of-a-calibration-file.json"


def lines_of(capsys: pytest.CaptureFixture[str], rows: list[list[object]]) -> list[str]:
    columns = ["backend", "p01 %", "tilt, mrad", "readout fit", "95 % interval", "error"]
    print_table(columns, rows, "a title", tight=True)
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("width", [1, 40, 80, 120])
def test_numbers_never_break(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    lines = lines_of(capsys, [["fake_lima", *NUMBERS], [NAME, *NUMBERS]])
    for number in NUMBERS:
        assert sum(number in line for line in lines) == 2
    shown = "".join(re.split(r"\s+", line[1:])[0] for line in lines if line.startswith(" "))
    assert NAME in shown, "a long name is shown whole, in several lines"
    assert "fake_lima" in shown
    if width >= 80:
        assert max(len(line) for line in lines) <= width


@pytest.mark.parametrize("columns", [None, "", "x"])
def test_without_a_terminal_no_line_is_broken(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: str | None
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    if columns is not None:
        monkeypatch.setenv("COLUMNS", columns)
    lines = lines_of(capsys, [[f"{index}{NAME}" * 3, *NUMBERS] for index in range(2)])
    for index in range(2):
        assert sum(f"{index}{NAME}" * 3 in line and NUMBERS[-1] in line for line in lines) == 1


def test_a_table_without_rows_has_its_header(capsys: pytest.CaptureFixture[str]) -> None:
    assert any("backend  p01 %" in line for line in lines_of(capsys, []))


@pytest.mark.parametrize("episodes", [1, 4, 5])
def test_few_episodes_have_no_interval(capsys: pytest.CaptureFixture[str], episodes: int) -> None:
    """`qcompile run` prints none below five, nor does the grid."""
    values: dict[str, Any] = {
        "policy": "tiny",
        "environment": "CartPole-v1",
        "backend": "ideal",
        "shots": 16,
        "mitigation": "none",
        "level": 2,
        "greedy": False,
        "circuits_per_step": 4,
        "mean_reward": 10.0,
        "std_reward": 1.0,
        "ci95": [9.0, 11.5],
        "paired_difference": None,
        "reference": True,
        "solved": None,
        "episodes": [{}] * episodes,
    }
    print_grid([values])
    out = capsys.readouterr().out
    assert ("9.0 to 11.5" in out) == (episodes >= 5)
    assert f"CartPole-v1, {episodes} episode{'s' * (episodes > 1)}, level 2" in out


@pytest.mark.parametrize(
    ("rewards", "texts"),
    [
        ((0.0,), ["0.00"]),
        ((123.456, 0.001), ["123.5", "0.0"]),
        ((9.99, -1), ["9.99", "-1.00"]),
        ((0.5,), ["0.50"]),
        ((0.0123, 0.0011), ["0.012", "0.001"]),
        ((-1.5e-3,), ["-0.0015"]),
        ((1.234e-11, 0.0), ["1.23e-11", "0.00e+00"]),
    ],
)
def test_rewards_have_two_digits_at_least(rewards: tuple[float, ...], texts: list[str]) -> None:
    assert [format(reward, reward_form(*rewards)) for reward in rewards] == texts


@pytest.mark.parametrize(
    ("mean", "deviation", "text"),
    [
        (3e-11, 1e-11, "3.00e-11 ± 1.00e-11"),
        (0.0, 2e-11, "0.00e+00 ± 2.00e-11"),
        (0.01, 5.0, "0.01 ± 5.00"),
        (200.0, 0.001, "200.0 ± 0.0"),
    ],
)
def test_a_deviation_is_not_rounded_away(mean: float, deviation: float, text: str) -> None:
    assert reward_text(mean, deviation) == text


def test_a_difference_of_rounding_is_none() -> None:
    assert difference_text(5.7e-14, 480.0) == "+0.00"
    assert difference_text(5.7e-14, 1e-13) == "+5.70e-14"


def test_the_table_of_a_grid_has_what_is_held_and_the_arguments() -> None:
    values: dict[str, Any] = {
        "policy": "p",
        "environment": "FrozenLake-v1",
        "environment_kwargs": {"is_slippery": False},
        "hold": 3,
        "backend": "ideal",
        "shots": "exact",
        "mitigation": "none",
        "level": 2,
        "greedy": False,
        "mean_reward": 0.123456789,
        "std_reward": 0.5,
        "ci95": None,
        "paired_difference": None,
        "reference": True,
        "solved": None,
        "episodes": [{}],
    }
    (row,) = csv.DictReader(grid_table([values]).csv().splitlines())
    assert row["environment"] == "FrozenLake-v1 (is_slippery=false)"
    assert row["hold"] == "3"
    assert row["mean reward"] == "0.123456789"
    assert row["solved"] == row["to ideal"] == ""
