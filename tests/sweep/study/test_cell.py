"""One training of a study: its averages, that it repeats, and the file it is kept in."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.errors import OutputError
from qcompile.rl.ppo import Trainer
from qcompile.rl.score import score
from qcompile.sweep.study.cell import CellResult, first_at, folder_of, run_cell
from qcompile.sweep.study.rows import Cell, Row

ShortRow = Callable[..., Row]


def test_an_average_is_over_20_episodes_or_what_there_is(summary: Any) -> None:
    """Rewards 1, 2, ... 30: after n <= 20 the mean is (n + 1) / 2, then it is n - 9.5."""
    (result,) = summary(range(1, 31)).results
    expected = [(n + 1) / 2 for n in range(1, 21)] + [n - 9.5 for n in range(21, 31)]
    assert result.averages.tolist() == expected
    assert result.full_averages.tolist() == [n - 9.5 for n in range(20, 31)]
    assert result.best_average == 20.5


def test_the_first_episode_at_the_target_is_the_20th_at_least(summary: Any) -> None:
    early, late, never = summary([100.0] * 25, [0.0] * 20 + [20.0] * 20, [9.9] * 40).results
    assert early.first_at(10.0) == 20, "not the first, which is above the target too"
    assert late.first_at(10.0) == 30, "10 of the last 20 pay 20"
    assert late.first_at(10.5) == 31
    assert late.first_at(20.0) == 40
    assert never.first_at(10.0) is None


def test_a_training_shorter_than_20_episodes_has_no_average_over_20(summary: Any) -> None:
    (result,) = summary([30.0, 0.0, 0.0]).results
    assert result.averages.tolist() == [30.0, 15.0, 10.0]
    assert (result.best_average, result.last_average) == (None, None)
    assert result.first_at(10.0) is None
    assert first_at(np.full(19, 7.0), 7.0) is None
    assert first_at(np.full(20, 7.0), 7.0) == 20


def test_episodes_of_many_environments_count_in_the_order_in_which_they_began(
    summary: Any,
) -> None:
    """21 environments begin together and earn 21, 20, ..., 1 for as many steps.

    In the order of their ends the first 20 average 10.5, in that of their numbers 11.5.
    """
    (result,) = summary([float(i) for i in range(1, 22)]).results
    steps = [21 * (i - 1) + (21 - i) + 1 for i in range(1, 22)]
    many = result.model_copy(update={"steps": steps, "settings": {"environments": 21}})
    assert many.full_averages.tolist() == [11.5, 10.5]
    assert (many.best_average, many.last_average) == (11.5, 10.5)
    assert many.first_at(11.0) == 20


def test_the_best_average_is_no_early_one(summary: Any) -> None:
    """A first episode of 100 is an average of 100 over one episode, and 5 over 20."""
    (result,) = summary([100.0] + [0.0] * 30).results
    assert result.best_average == 5.0


def test_a_cell_repeats(short_row: ShortRow) -> None:
    first, again = (run_cell(Cell(short_row(), 1), 2) for _ in range(2))
    other = run_cell(Cell(short_row(), 2), 2)
    assert first.model_dump(exclude={"wall_seconds"}) == again.model_dump(exclude={"wall_seconds"})
    assert first.rewards != other.rewards


@pytest.mark.parametrize("name", ["cartpole-svqc-paper", "cartpole-fcn-large-paper"])
def test_a_cell_is_a_training_and_its_score(short_row: ShortRow, name: str) -> None:
    row = short_row(name)
    result = run_cell(Cell(row, 4), 3)
    trainer = Trainer("CartPole-v1", row.settings, 4)
    trained = trainer.train()
    assert result.rewards == [episode.reward for episode in trained.episodes]
    assert result.steps == np.cumsum(result.rewards).tolist(), "CartPole pays 1 a step"
    assert len(result.rewards) == 3
    assert result.evaluation == score(trainer, 3, 10_000).tolist()
    assert (result.row, result.seed, result.environment) == (name, 4, "CartPole-v1")
    assert result.settings["episodes"] == 3


# The paper's circuits: an angle each of 4, a weight for each of 4 and 2 actions, copies of output
# reuse folded, and 2 biases; its network: 4 -> 16 -> 32 -> 64 -> 32 -> 2.
PARAMETERS = {
    "cartpole-svqc-paper": 4 + 4 * 2 + 2,
    "cartpole-fcn-large-paper": 5 * 16 + 17 * 32 + 33 * 64 + 65 * 32 + 33 * 2,
}


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_cell_counts_parameters(short_row: ShortRow, name: str) -> None:
    assert run_cell(Cell(short_row(name), 0), 1).parameters == PARAMETERS[name]


def test_an_interrupted_training_is_no_result(
    short_row: ShortRow, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Trainer, "_update", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_cell(Cell(short_row(), 0), 1)


# The file of a cell.


@pytest.fixture
def stored(short_row: ShortRow, tmp_path: Path) -> tuple[Cell, CellResult]:
    """A cell, and its result in a file in tmp_path / "cells"."""
    cell = Cell(short_row(), 3)
    result = run_cell(cell, 2)
    folder_of(tmp_path).write(cell, result)
    return cell, result


def test_a_result_is_read_back(stored: tuple[Cell, CellResult], tmp_path: Path) -> None:
    cell, result = stored
    assert [path.name for path in (tmp_path / "cells").iterdir()] == [
        "cartpole-svqc-paper-seed3.json"
    ]
    assert folder_of(tmp_path).read(cell) == result
    assert folder_of(tmp_path, 2).read(cell) == result
    values = json.loads((tmp_path / "cells" / f"{cell.name}.json").read_text())
    assert (values["format"], values["seed"]) == ("qcompile-study-1", 3)
    assert values["rewards"] == result.rewards


def test_a_result_is_that_of_its_cell_alone(
    stored: tuple[Cell, CellResult], tmp_path: Path, short_row: ShortRow
) -> None:
    cell, _ = stored
    folder = folder_of(tmp_path)
    assert folder_of(tmp_path, 3).read(cell) is None, "other number of evaluation episodes"
    assert folder_of(tmp_path / "cells").read(cell) is None, "no such file"
    assert folder.read(Cell(short_row(episodes=4), 3)) is None, "other settings"
    assert folder.read(Cell(short_row(clip=0.2), 3)) is None, "other settings"
    assert folder.read(Cell(replace(cell.row, environment="CartPole-v0"), 3)) is None
    other = Cell(cell.row, 5)
    folder.file(other).write_bytes(folder.file(cell).read_bytes())
    assert folder.read(other) is None, "the file of another seed"


@pytest.mark.parametrize(
    "damage",
    {
        "empty": lambda text: "",
        "cut": lambda text: text[:-20],
        "no JSON": lambda text: "\0" * 100,
        "a list": lambda text: "[]",
        "other format": lambda text: text.replace("qcompile-study-1", "qcompile-study-2"),
        "unknown value": lambda text: text.replace('"seed"', '"more": 1, "seed"', 1),
        "no rewards": lambda text: text.replace('"rewards"', '"reward"'),
    }.items(),
    ids=lambda item: item[0],
)
def test_a_damaged_file_is_no_result(
    stored: tuple[Cell, CellResult], tmp_path: Path, damage: tuple[str, Callable[[str], str]]
) -> None:
    cell, _ = stored
    file = tmp_path / "cells" / f"{cell.name}.json"
    changed = damage[1](file.read_text())
    assert changed != file.read_text()
    file.write_text(changed)
    assert folder_of(tmp_path).read(cell) is None


def test_a_result_that_cannot_be_written(stored: tuple[Cell, CellResult], tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file is not a folder"):
        folder_of(tmp_path / "file").write(*stored)
