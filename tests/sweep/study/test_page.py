"""What the seeds of a row say together, and how it is written up."""

from __future__ import annotations

import csv
import re
import shutil
import statistics
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from qcompile.errors import StudyError
from qcompile.report.curves import draw_curves
from qcompile.rl.settings import Settings, plain
from qcompile.sweep.study import StudyRequest
from qcompile.sweep.study.cell import folder_of
from qcompile.sweep.study.page import page
from qcompile.sweep.study.rows import Cell, Claim, Figure, Row, Rows, cells
from qcompile.sweep.study.studies import open_study
from qcompile.sweep.study.summary import RowSummary, curve_episodes, curves_csv, results_csv
from qcompile.sweep.study.verdict import verdict
from qcompile.sweep.study.write_up import figure_panels, summaries, write_up

Make = Callable[..., RowSummary]
DOCS = Path(__file__).parents[3] / "docs"

# From the episode that it names a seed pays 20, before it 0: the average of 20 is at 10 when ten
# of these are paid.
AT_30 = [0.0] * 20 + [20.0] * 30
AT_40 = [0.0] * 30 + [20.0] * 30
NEVER = [0.0] * 45


def read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(text)))


# The figures of a row.


def test_the_mean_of_the_seeds_reaches_the_target_in_its_own_time(summary: Make) -> None:
    """The averages rise by 1 an episode, from 20 and 30 on: their mean is 10 after 35."""
    both = summary(AT_30, AT_40)
    assert both.each_first == [30, 40]
    assert both.mean_first == 35
    assert both.median_first == 35.0


def test_a_seed_that_fails_holds_the_mean_back(summary: Make) -> None:
    """The first is at 20 after 40 episodes, with 0 for the other the mean is 10 then."""
    row = summary(AT_30, NEVER)
    assert row.each_first == [30, None]
    assert row.mean_first == 40
    assert summary(AT_30, NEVER, NEVER).mean_first is None


@pytest.mark.parametrize(
    ("seeds", "median"),
    [
        ([AT_30], 30.0),
        ([NEVER], None),
        ([AT_30, AT_40, NEVER], 40.0),
        ([AT_30, NEVER, NEVER], None),
        ([AT_30, NEVER], None),
        ([AT_40, AT_30, AT_30, NEVER], 35.0),
        ([AT_40, AT_40, NEVER, NEVER], None),
    ],
)
def test_the_median_seed(summary: Make, seeds: list[list[float]], median: float | None) -> None:
    assert summary(*seeds).median_first == median


def test_the_curve_ends_with_the_shortest_training(summary: Make) -> None:
    row = summary([4.0] * 50, [8.0] * 30)
    assert row.averages.shape == (2, 30)
    assert row.mean_curve.tolist() == [6.0] * 30


def test_the_other_figures_of_a_row(summary: Make) -> None:
    fall = [20.0] * 20 + [0.0] * 10
    row = summary(AT_30, fall, evaluation=[[1.0, 2.0], [10.0, 20.0, 30.0]])
    assert row.best.tolist() == [20.0, 20.0]
    assert row.final.tolist() == [20.0, 10.0]
    assert row.evaluation.tolist() == [1.5, 20.0]
    assert row.parameters == 1234
    values = row.values()
    assert values["seeds"] == [0, 1]
    assert values["evaluation_mean"] == [1.5, 20.0]
    assert values["each_at_target"] == [30, 20]


def test_curves_are_drawn_through_200_episodes_at_most() -> None:
    assert curve_episodes(1).tolist() == [1]
    assert curve_episodes(200).tolist() == list(range(1, 201))
    many = curve_episodes(5000).tolist()
    assert (many[0], many[-1], len(many)) == (1, 5000, 200)
    assert {b - a for a, b in pairwise(many)} <= {25, 26}


# The tables.


def test_results_csv(summary: Make) -> None:
    rows = [
        summary(AT_30, NEVER, evaluation=[[1.0, 2.0], [5.0, 5.0]]),
        summary([1.0], name="other", title='a, "b"'),
    ]
    lines = read(results_csv(rows))
    assert [(line["row"], line["seed"]) for line in lines] == [
        ("cartpole-svqc-paper", "0"),
        ("cartpole-svqc-paper", "1"),
        ("other", "0"),
    ]
    assert lines[0] == {
        "row": "cartpole-svqc-paper",
        "title": "SVQC",
        "environment": "CartPole-v1",
        "preset": "paper",
        "seed": "0",
        "parameters": "1234",
        "episodes": "50",
        "steps": "500",
        "target": "10.0",
        "episodes_to_target": "30",
        "best_average": "20.00",
        "last_average": "20.00",
        "evaluation_mean": "1.50",
        "evaluation_std": "0.50",
    }
    assert lines[1]["episodes_to_target"] == ""
    assert lines[2]["title"] == 'a, "b"'


def test_curves_csv(summary: Make) -> None:
    first, second = [4.0] * 300, [1.0, 3.0, *[2.0] * 299]
    lines = read(curves_csv([summary(first, second), summary([7.0, 8.0], name="other")]))
    assert [line["row"] for line in lines] == ["cartpole-svqc-paper"] * 200 + ["other"] * 2
    assert list(lines[0].values()) == ["cartpole-svqc-paper", "1", "2.50", "1.50", "1.00", "4.00"]
    assert lines[199]["episode"] == "300"
    assert lines[199]["mean"] == "3.00"
    assert list(lines[201].values()) == ["other", "2", "7.50", "0.00", "7.50", "7.50"]
    for line in lines[:200]:
        end = int(line["episode"])
        values = [statistics.mean(seed[max(end - 20, 0) : end]) for seed in (first, second)]
        assert float(line["mean"]) == pytest.approx(statistics.mean(values), abs=0.0051)
        assert float(line["std"]) == pytest.approx(statistics.pstdev(values), abs=0.0051)


# The paper's number.


@pytest.mark.parametrize(
    ("claimed", "changes", "words"),
    [
        (None, {}, "-"),
        (30, {}, "holds: 1.17 times the episodes"),
        (35, {}, "holds: 1.00 times the episodes"),
        (350, {}, "holds: 0.10 times the episodes"),
        (28, {}, "does not hold: 1.25 times the episodes"),
        (30, {"target": 20.5}, "does not hold: not reached"),
        # The best seed counts, which takes 30.
        (25, {"of": "best"}, "holds: the best seed needs 1.20 times the episodes"),
        (24, {"of": "best"}, "does not hold: the best seed needs 1.25 times the episodes"),
        (24, {"of": "best", "target": 20.5}, "does not hold: not reached"),
    ],
)
def test_the_verdict(
    summary: Make, claimed: int | None, changes: dict[str, Any], words: str
) -> None:
    """The mean of the seeds is at the target after 35 episodes."""
    claim = Claim("-", claimed, changes.pop("of", "mean"))
    assert verdict(summary(AT_40, AT_30, claim=claim, **changes)) == words


@pytest.mark.parametrize(
    ("results", "changes", "words"),
    [
        # The paper takes 100 episodes; at 120 at most it holds.
        ([NEVER, NEVER], {}, "not tested: 45 of 120 episodes"),
        ([[0.0] * 119, [0.0] * 200], {}, "not tested: 119 of 120 episodes"),
        ([[0.0] * 120, [0.0] * 200], {}, "does not hold: not reached"),
        ([AT_30, AT_40], {"seeds": 5}, "not tested: 2 of 5 seeds"),
        ([NEVER] * 2, {"seeds": 5}, "not tested: 2 of 5 seeds"),
        # Of the best of ten one may already do.
        ([AT_30, NEVER], {"seeds": 10, "of": "best"}, "holds: the best seed needs 0.30 times"),
        ([NEVER] * 2, {"seeds": 10, "of": "best"}, "not tested: 2 of 10 seeds"),
        # With more seeds than the claim has, the best of all is better than its best.
        ([[0.0] * 120, AT_30], {"seeds": 1, "of": "best"}, "does not hold: not reached"),
        # A seed that stopped early could have been the best.
        ([[0.0] * 300 + [20.0] * 20, NEVER], {"of": "best"}, "not tested: 45 of 120 episodes"),
    ],
)
def test_no_verdict_without_the_episodes_and_seeds_for_it(
    summary: Make, results: list[list[float]], changes: dict[str, Any], words: str
) -> None:
    claim = Claim("-", 100, changes.pop("of", "mean"))
    seeds = tuple(range(changes.get("seeds", len(results))))
    assert verdict(summary(*results, claim=claim, seeds=seeds)).startswith(words)


def test_seeds_of_an_earlier_list_are_not_those_of_the_claim(summary: Make) -> None:
    row = summary(AT_30, AT_40, claim=Claim("-", 100), seeds=(1, 7))
    assert verdict(row) == "not tested: 1 of 2 seeds"


def test_a_first_look_says_what_it_cannot_say(summary: Make) -> None:
    """One seed does not scatter, and 19 episodes have no average over 20."""
    claim = Claim("about 30", 30)
    short = summary([5.0] * 19, claim=claim, evaluation=[[1.0, 2.0]], seeds=(0, 1, 2, 3, 4))
    lines = tables(paged([short]))["Poles"]
    assert lines[2][4:] == ["under 20 episodes", "0 of 1", "not tested: 1 of 5 seeds"]
    assert lines[5][2:] == [
        "under 20 episodes",
        "under 20 episodes",
        "1.50, one seed, lowest 1.50",
    ]
    assert short.values()["best_average"] == short.values()["last_average"] == [None]
    (row,) = read(results_csv([short]))
    assert (row["best_average"], row["last_average"]) == ("", "")


# The page and its pictures.

FIGURES = {
    "cartpole": Figure("Poles"),
    "reuse": Figure("Reuse", ("cartpole-svqc-paper",)),
    "lunarlander": Figure("Moon", last_episode=30),
}
COMMAND = "qcompile study mine.toml --out s"


def study_of(several: Sequence[RowSummary], *more: Row) -> Rows:
    """A study of these rows as they were trained, and of more."""
    rows = {summary.row.name: summary.row for summary in several} | {row.name: row for row in more}
    return Rows("mine.toml", "Mine", "What for.", FIGURES, tuple(rows.values()))


def paged(several: Sequence[RowSummary], study: Rows | None = None, folder: str = "study") -> str:
    """The page of trainings that a command repeats, all of them."""
    repeated = [f"{s.row.name}-seed{seed}" for s in several for seed in s.seeds]
    versions = {"torch": "1.2", "numpy": "3.4"}
    return page(study or study_of(several), several, COMMAND, repeated, folder, versions)


@pytest.fixture
def several(summary: Make) -> list[RowSummary]:
    claim = Claim("about 30", 30)
    return [
        summary(AT_40, AT_30, claim=claim, evaluation=[[1.0, 2.0], [5.0, 6.0]]),
        summary(AT_30, NEVER, name="cartpole-svqc-tuned", preset="tuned"),
        summary(NEVER, name="reuse-svqc-4-paper", title="SVQC, reuse 4", figure="reuse"),
        summary(NEVER, figure="lunarlander", name="l", title="SVQC", target=220.0),
        summary(NEVER, figure="lunarlander", name="f", title="FCN, large", target=200.0),
    ]


def tables(text: str) -> dict[str, list[list[str]]]:
    """By the heading above: the cells of the lines below the head."""
    sections: dict[str, list[list[str]]] = {}
    lines: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith("## "):
            lines = sections.setdefault(line[3:], [])
        elif line.startswith("| "):
            lines.append([cell.strip() for cell in line[1:-1].split("|")])
    return sections


def test_the_page_has_a_line_for_each_row(several: list[RowSummary]) -> None:
    sections = tables(paged(several))
    assert list(sections) == ["Poles", "Reuse", "Moon", "Repeat it"]
    cartpole, reuse, lunarlander, _ = sections.values()
    assert [len(line) for line in cartpole] == [7] * 4 + [5] * 4
    assert [line[:2] for line in cartpole[2:4]] == [["SVQC", "`paper`"], ["SVQC", "`tuned`"]]
    assert [line[:2] for line in cartpole[6:]] == [["SVQC", "`paper`"], ["SVQC", "`tuned`"]]
    assert [line[0] for line in reuse[2:4]] == ["SVQC", "SVQC, reuse 4"]
    assert [line[0] for line in lunarlander[6:]] == ["SVQC", "FCN, large"]
    assert cartpole[2][2:] == [
        "1,234",
        "about 30",
        "35",
        "2 of 2: 35, 30 to 40",
        "holds: 1.17 times the episodes",
    ]
    assert cartpole[6][2:] == ["20.0 ± 0.0", "20.0 ± 0.0", "3.50 ± 2.00, lowest 1.50"]
    assert cartpole[3][4:6] == ["40", "1 of 2: 30 to 30"]
    assert reuse[3][4:6] == ["not reached", "0 of 1"]


def test_the_page_says_the_targets_and_the_versions(several: list[RowSummary]) -> None:
    text = paged(several)
    assert text.startswith("# Mine\n\nThis page is written by `qcompile study mine.toml` from the ")
    assert "\nWhat for.\n" in text
    assert "Target: an average of 220 (200 for FCN, large, paper).\n" in text
    assert " Target: an average of 10.\n" in text
    assert "Made with torch 1.2, numpy 3.4;" in text
    words = " ".join(text.split())
    assert "is trained with 1 to 2 seeds" in words
    assert "plays 2 fresh episodes" in words
    assert f"## Repeat it\n\n```\n{COMMAND}\n```\n\nTrainings that are" in text
    assert "part of the study" not in text
    assert not re.search(r"[{}]|None|nan", text)


def request_of(several: Sequence[RowSummary], out: Path, page: Path) -> StudyRequest:
    request = StudyRequest(name="mine.toml", out=out, page=page)
    vars(request)["study"] = study_of(several)
    return request


@pytest.mark.parametrize(("folder", "place"), [("docs/study", "docs"), ("study", "study")])
def test_a_write_up_is_files_that_the_page_links(
    several: list[RowSummary], tmp_path: Path, folder: str, place: str
) -> None:
    where, at = tmp_path / folder, tmp_path / place / "page.md"
    paths = write_up(request_of(several, where, at), several)
    names = ["results.csv", "curves.csv", "cartpole.png", "reuse.png", "lunarlander.png"]
    assert paths == [*(where / name for name in names), at]
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == sorted(paths)
    links = re.findall(r"\]\((.+?)\)", at.read_text())
    linked = {(at.parent / link).resolve() for link in links if link != "training.md"}
    assert linked == set(paths) - {at}
    assert (where / "results.csv").read_text() == results_csv(several)
    assert (where / "curves.csv").read_text() == curves_csv(several)
    for name in names[2:]:
        with Image.open(where / name) as picture:
            picture.load()
            assert (picture.format, picture.width) == ("PNG", 1020)


def test_trainings_of_two_versions_are_both_named(
    several: list[RowSummary], tmp_path: Path
) -> None:
    first, second = several[0].results
    newer = second.model_copy(update={"versions": {"torch": "1.3", "numpy": "3.4"}})
    stored = [replace(several[0], results=(first, newer))]
    write_up(request_of(stored, tmp_path, tmp_path / "page.md"), stored)
    assert "torch 1.2 and 1.3, numpy 3.4;" in (tmp_path / "page.md").read_text()


def test_nothing_to_write_up(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="There are no trainings in"):
        write_up(StudyRequest(out=tmp_path), [])
    assert list(tmp_path.iterdir()) == []


def test_the_page_says_environments_and_changes_of_presets(summary: Make) -> None:
    changes = {"hidden": [3, 4], "entropy": "none"}
    lake = {"figure": "reuse", "environment": "FrozenLake-v1", "name": "lake"}
    lake |= {"arguments": {"map_name": "4x4", "is_slippery": False}}
    text = paged([summary(AT_30, changes=changes), summary(AT_30, **lake)])
    assert "Environment: `CartPole-v1`. Target: an average of 10.\n" in text
    assert (
        'Environment: `CartPole-v1` and `FrozenLake-v1` with map_name = "4x4", '
        "is_slippery = false. Target: an average of 10.\n"
    ) in text
    assert '| `cartpole-svqc-paper` | hidden = [3, 4], entropy = "none" |\n\n## Repeat' in text
    assert "## Settings" not in paged([summary(AT_30)])


# What a page may not promise.


def test_columns_without_claims_or_targets_are_left_out(summary: Make) -> None:
    plain = [summary(AT_30, NEVER)]
    first, _, _, second, *_ = tables(paged(plain))["Poles"]
    assert first == ["model", "preset", "parameters", "mean of seeds at target", "seeds at target"]
    assert second == ["model", "preset", "best average", "last average", "fresh episodes"]
    assert not re.search("claim|verdict", paged(plain))
    aimless = paged([summary(AT_30, target=None)])
    assert len(tables(aimless)["Poles"][0]) == 6
    assert "arget" not in aimless
    both = [summary(AT_30), summary(AT_30, name="cartpole-fcn-paper", title="FCN", target=None)]
    lines = tables(paged(both))["Poles"]
    assert [line[3:5] for line in lines[2:4]] == [["30", "1 of 1: 30, 30 to 30"], ["-", "-"]]
    assert "Target: an average of 10 (none for FCN, paper).\n" in paged(both)


def test_a_part_of_a_study_says_what_was_trained(summary: Make) -> None:
    """Of three rows the first has fewer episodes, the second fewer seeds, the third nothing."""
    several = [
        summary([1.0] * 25, [1.0] * 23, settings=Settings(episodes=23)),
        summary(AT_30, name="cartpole-svqc-tuned", preset="tuned"),
    ]
    rows = [
        replace(several[0].row, settings=Settings(episodes=1000, steps=20_000)),
        replace(several[1].row, seeds=(0, 4)),
        replace(several[1].row, name="cartpole-fcn-tuned"),
    ]
    text = paged(several, study_of(several, *rows))
    assert "This page shows only a part of the study.\n" in text
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    assert lines == [
        "| `cartpole-svqc-paper` | 2 seeds | 23 to 25 episodes | 2 seeds | "
        "1,000 episodes or 20,000 steps |",
        "| `cartpole-svqc-tuned` | 1 seed | 50 episodes | 2 seeds | 1 episode |",
    ]
    assert (
        "These rows are missing, because they were not trained, or with other settings: "
        "`cartpole-fcn-tuned`.\n" in text
    )
    with_all = paged(several, study_of(several))
    assert "part of the study" not in with_all


def test_trainings_that_the_command_does_not_repeat_are_named(summary: Make) -> None:
    several = [summary(AT_30, NEVER), summary(AT_30, name="other")]
    study = study_of(several)
    text = page(study, several, COMMAND, ["cartpole-svqc-paper-seed0"], "study", {})
    assert (
        "This command does not repeat the other trainings in the folder: "
        "`cartpole-svqc-paper` (seed 1), `other` (seed 0). "
    ) in text
    assert "the other trainings in the folder" not in paged(several)


def test_fresh_episodes_of_two_numbers_are_both_said(summary: Make) -> None:
    mixed = [summary(AT_30, NEVER, evaluation=[[1.0], [1.0] * 100])]
    assert "plays 1 to 100 fresh episodes" in " ".join(paged(mixed).split())


def test_words_of_a_file_stay_in_their_cells(summary: Make) -> None:
    several = [summary(AT_30, title="a | b <i>", claim=Claim("about | 30", 30))]
    study = replace(study_of(several), title="<script>", about="1 < 2 | 3")
    text = paged(several, study)
    assert "# &lt;script>\n" in text
    assert "| a \\| b &lt;i> | `paper` | 1,234 | about \\| 30 |" in text
    panels = figure_panels(study, [summary(AT_30, title="$x_{$ and $y$")])
    assert draw_curves([panels["cartpole"]]).png.startswith(b"\x89PNG"), "a dollar is plain text"


# What a folder holds.


def test_a_folder_is_read_row_by_row(
    short_row: Callable[..., Any], summary: Make, tmp_path: Path
) -> None:
    """Two of three seeds of one row are there, one with other evaluation episodes; none of the
    other row."""
    row, other = replace(short_row(), seeds=(0, 1, 2)), short_row("cartpole-svqc-tuned")
    folder = folder_of(tmp_path, 2)
    assert len(folder.missing(cells([row, other]))) == 8
    settings = plain(short_row().settings)
    by_hand = summary([1.0], [2.0], [3.0], evaluation=[[1.0, 2.0], [], [3.0]])
    for seed in (0, 2):
        result = by_hand.results[seed].model_copy(update={"settings": settings})
        folder.write(Cell(row, seed), result)
    assert [cell.seed for cell in folder.missing(cells([row]))] == [1, 2]
    assert folder.missing(cells([row], 1)) == []
    (folder.cells / f"{row.name}-seedling.json").touch()
    (stored,) = summaries([row, other], tmp_path)
    assert [result.seed for result in stored.results] == [0, 2]


# What is committed.


def test_the_committed_trainings_are_those_of_todays_presets() -> None:
    every = cells(open_study("paper").rows)
    assert folder_of(DOCS / "study", 100).missing(every) == []
    files = {path.name for path in (DOCS / "study" / "cells").iterdir()}
    assert files == {f"{cell.name}.json" for cell in every}


def test_the_committed_page_is_what_they_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(DOCS / "study" / "cells", tmp_path / "docs/study/cells")
    monkeypatch.chdir(tmp_path)
    request = StudyRequest(name="paper", out="docs/study", page="docs/background/reproduction.md")
    assert f"$(BIN)/{request.command}\n" in (DOCS.parent / "Makefile").read_text()
    stored = summaries(request.study.rows, request.folder)
    for path in write_up(request, stored):
        there = DOCS.parent / path
        assert there.is_file()
        if path.suffix != ".png":  # fonts differ a little from machine to machine
            assert there.read_text() == path.read_text()
