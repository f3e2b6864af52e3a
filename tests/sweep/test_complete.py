"""A folder is completed: what it lacks is run, what is finished stays, whatever ends the sweep."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from qcompile.errors import OutputError, StudyError
from qcompile.sweep.complete import CellFailure, Pool, complete
from qcompile.sweep.folder import Folder


@dataclass(frozen=True)
class Square:
    """A cell whose result is the square of a number."""

    number: int

    @property
    def name(self) -> str:
        return f"square-{self.number}"


class Answer(BaseModel):
    value: int


CELLS = [Square(number) for number in (2, 3, 4)]


def matching(cell: Square, answer: Answer) -> Answer | None:
    return answer if answer.value == cell.number**2 else None


@pytest.fixture
def folder(tmp_path: Path) -> Folder[Square, Answer]:
    return Folder(tmp_path / "s", Answer, matching)


@pytest.fixture
def engine_calls(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What the engine is asked for; it runs the cells here, one after the other."""
    calls: list[dict[str, Any]] = []

    def run_all(cells: Any, run: Any, on_result: Callable[..., None], **how: Any) -> None:
        calls.append({"cells": [*cells], **how})
        for cell in cells:
            on_result(cell, run(cell))

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)
    return calls


def squared(cell: Square) -> Answer | CellFailure:
    return Answer(value=cell.number**2)


def swept(folder: Folder[Square, Answer], run: Any = squared) -> tuple[Any, list[Any]]:
    """What came of it, and the progress that was told."""
    progress: list[Any] = []
    completed = complete(
        CELLS,
        folder,
        run,
        Pool("dask", "tcp://here", 7),
        lambda *words: progress.append(words),
        describe=lambda answer: f"= {answer.value}",
        noun="sum",
    )
    return completed, progress


def test_what_is_missing_is_run_and_written(
    folder: Folder[Square, Answer], engine_calls: list[dict[str, Any]]
) -> None:
    folder.write(CELLS[1], Answer(value=9))
    assert folder.file(CELLS[1]) == folder.path / "cells" / "square-3.json"
    assert folder.file(CELLS[1]).read_text() == '{"value": 9}\n'
    assert folder.missing(CELLS) == [CELLS[0], CELLS[2]]
    completed, progress = swept(folder)
    assert {name: answer.value for name, answer in completed.results.items()} == {
        "square-2": 4,
        "square-3": 9,
        "square-4": 16,
    }
    assert (completed.run, completed.there, completed.failures) == (2, 1, [])
    assert progress == [(1, 3, "1 of 3 sums loaded"), (2, 3, "= 4"), (3, 3, "= 16")]
    (call,) = engine_calls
    assert call["cells"] == [CELLS[0], CELLS[2]]
    assert (call["engine"], call["address"], call["workers"]) == ("dask", "tcp://here", 7)
    assert call["noun"] == "sum"
    assert folder.finished(CELLS) == completed.results
    assert swept(folder)[0].run == 0


@pytest.mark.parametrize("contents", ["", "[]", '{"value": 5}', '{"value": "x"}', "\0"])
def test_a_file_of_something_else_is_no_result(
    folder: Folder[Square, Answer], contents: str
) -> None:
    folder.write(CELLS[0], Answer(value=4))
    folder.file(CELLS[0]).write_text(contents)
    assert folder.read(CELLS[0]) is None


@pytest.mark.usefixtures("engine_calls")
def test_a_failure_is_not_written_and_leaves_the_others_alone(
    folder: Folder[Square, Answer],
) -> None:
    failure = CellFailure("square-3", "It cannot be squared.")
    completed, progress = swept(folder, lambda c: failure if c == CELLS[1] else squared(c))
    assert completed.failures == [failure]
    assert [json.loads(path.read_text())["value"] for path in sorted(folder.cells.iterdir())] == [
        4,
        16,
    ]
    assert progress == [(0, 3, ""), (1, 3, "= 4"), (2, 3, "square-3 failed"), (3, 3, "= 16")]


@pytest.mark.usefixtures("engine_calls")
def test_ctrl_c_keeps_what_is_finished(folder: Folder[Square, Answer]) -> None:
    def interrupted(cell: Square) -> Answer | CellFailure:
        if cell == CELLS[2]:
            raise KeyboardInterrupt
        return squared(cell)

    with pytest.raises(StudyError) as raised:
        swept(folder, interrupted)
    assert str(raised.value) == (
        "Interrupted: 2 of 3 sums finished.\n"
        f"  They are in {folder.path}; the same command resumes with the others."
    )
    assert folder.missing(CELLS) == [CELLS[2]]


def test_a_folder_that_cannot_be_written_is_told_before(folder: Folder[Square, Answer]) -> None:
    folder.check_writable()
    assert not folder.path.exists()
    folder.path.touch()
    with pytest.raises(
        OutputError, match=r"Cannot write .*s/cells/cell\.json\.\n.*s is not a folder"
    ):
        folder.check_writable()
