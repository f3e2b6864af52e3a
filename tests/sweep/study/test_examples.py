"""The studies that are shown: that of docs/howto/studies.md, and examples/study.toml, cut short."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

import qcompile
from qcompile.sweep.study.rows_file import _FigureTable, _File, _RowTable
from qcompile.sweep.study.studies import open_study

CHECKOUT = Path(__file__).parents[3]
PAGE = (CHECKOUT / "docs" / "howto" / "studies.md").read_text()
(TOML,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_study_of_the_documentation_is_trained() -> None:
    Path("mine.toml").write_text(TOML)
    study = qcompile.study("mine.toml", seeds=1, episodes=1, evaluation=1, workers=1)
    assert study.page == Path("mine/reproduction.md")
    assert [row[:2] for row in study.table().words] == [
        ["pole-svqc-paper", "1"],
        ["pole-svqc-tuned", "1"],
        ["pole-svqc-slow-tuned", "1"],
        ["lake-svqc-tuned", "1"],
    ]
    assert [row[3:5] for row in study.table().words] == [["475", "never"]] * 3 + [["-", "-"]]
    rows = [*csv.DictReader(study.table().csv().splitlines())]
    assert rows[0]["last average, mean"] == ""
    for row, values in zip(rows, study.to_dict()["rows"], strict=True):
        (average,) = values["last_average"]  # an episode has no average of twenty
        assert row["last average, mean"] == ("" if average is None else str(average))
        assert [float(row["fresh episodes, mean"])] == values["evaluation_mean"]
        assert row["fresh episodes, standard deviation"] == "", "a seed has no deviation"
        assert row["mean at target"] == "", "never"
    assert study.plot("lake").png == Path("mine/lake.png").read_bytes()
    text = study.page.read_text()
    assert "| `lake-svqc-tuned` | 1 seed | " in text
    assert "| 3 seeds | 40,000 steps |" in text


def test_the_example_is_trained() -> None:
    path = CHECKOUT / "examples" / "study.toml"
    assert [len(row.seeds) for row in open_study(path).rows] == [3, 3, 3]
    study = qcompile.study(path, seeds=1, episodes=2, evaluation=1, workers=1, out="look")
    assert study.trained == 3
    assert f"qcompile study {path} --seeds 1 --episodes 2" in study.page.read_text()


def test_the_page_has_every_key() -> None:
    keys = {key for table in (_File, _FigureTable, _RowTable) for key in table.model_fields}
    documented = set(re.findall(r"`(\w+)`", PAGE.partition("## What is written")[0]))
    assert keys - {"figures"} <= documented
