"""`study` from Python: chosen rows, trained once and written up; what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from qcompile.errors import StudyError
from qcompile.sweep.study import study, study_rows
from qcompile.sweep.study.paper import rows

TINY: dict[str, Any] = {
    "rows": "cartpole-fcn-small",
    "episodes": 2,
    "evaluation": 1,
    "seeds": 1,
}


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_study_is_trained_once_and_written_up() -> None:
    progress: list[Any] = []
    left = {"row": "cartpole-fcn-small-paper", "environment": "CartPole-v1", "seeds": 1, "left": 1}
    assert study_rows(**TINY) == [left]
    first = study(**TINY, workers=1, on_progress=lambda *words: progress.append(words))
    assert (first.trained, first.there, first.page) == (1, 0, Path("study/reproduction.md"))
    assert [path.name for path in first.files] == [
        "results.csv",
        "curves.csv",
        "cartpole.png",
        "reproduction.md",
    ]
    (summary,) = first.summaries
    assert first.to_dict() == {
        "study": "paper",
        "rows": [summary.values()],
        "trained": 1,
        "files": [str(path) for path in first.files],
    }
    assert progress == [(0, 1, ""), (1, 1, "cartpole-fcn-small-paper, seed 0")]
    assert study_rows(**TINY) == [left | {"left": 0}]
    again = study(**TINY, page="page.md")
    assert (again.trained, again.there, again.page) == (0, 1, Path("page.md"))
    assert again.to_dict()["rows"] == first.to_dict()["rows"]


def test_a_first_look_replaces_no_training() -> None:
    study(**TINY, workers=1)
    with pytest.raises(StudyError, match=r"^study holds 1 of these trainings with other settings"):
        study(**TINY | {"episodes": 3})


def test_rows_are_chosen_by_figure_and_name() -> None:
    names = [values["row"] for values in study_rows()]
    assert names == [row.name for row in rows()]
    chosen = [values["row"] for values in study_rows(figures="reuse", rows=["cartpole", "reuse"])]
    assert chosen == ["cartpole-svqc-paper", *(f"reuse-svqc-{n}-paper" for n in (4, 8, 32))]


def test_another_study_is_refused() -> None:
    with pytest.raises(StudyError, match=r"^Unknown study 'rainbow'\.\n  Known: paper\."):
        study_rows("rainbow")
