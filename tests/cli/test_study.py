"""`qcompile study`: a tiny study, one that resumes, and what is refused before any training."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from qcompile.sweep.study.studies import open_study

Call = Callable[..., Any]

PAPER = open_study("paper").rows
ROW = ("study", "paper", "--row", "cartpole-svqc-paper")
FEW = ("--episodes", 3, "--evaluation", 2)
ONE = (*ROW, *FEW, "--seeds", 1, "--workers", 1)


@pytest.fixture(autouse=True)
def same_threads() -> Iterator[None]:
    """A training in this process sets the number of threads: put it back."""
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def untrained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is trained."""

    def run_all(*_: Any, **__: Any) -> None:
        pytest.fail("trained before everything was checked")

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)


def test_help_names_figures_and_engines(qcompile: Call) -> None:
    answer = qcompile("study", "--help")
    assert (answer.code, answer.err) == (0, "")
    for word in ("lunarlander", "--seeds", "dask", "ray", "Ctrl-C", "reproduction.md"):
        assert word in answer.out


@pytest.mark.usefixtures("untrained")
def test_rows_are_listed(qcompile: Call, left: Call) -> None:
    answer = qcompile("study", "paper", "--list")
    assert (answer.code, answer.err) == (0, "")
    listed = [line.split() for line in answer.out.splitlines() if "-" in line and " " in line]
    names = {row.name: [row.environment, *[str(len(row.seeds))] * 2] for row in PAPER}
    assert {words[0]: words[1:] for words in listed if words[0] in names} == names
    assert left() == []


@pytest.mark.usefixtures("untrained")
def test_rows_are_listed_as_json(qcompile: Call) -> None:
    document = qcompile("study", "--list", "--json", "--row", "acrobot-svqc", "--seeds", 2).json()
    assert document == [
        {"row": f"acrobot-svqc-{preset}", "environment": "Acrobot-v1", "seeds": 2, "left": 2}
        for preset in ("paper", "tuned", "critic-tuned")
    ]
    names = [row["row"] for row in qcompile("study", "--list", "--json").json()]
    assert names == [row.name for row in PAPER]


def test_a_tiny_study_is_written_up_and_not_trained_again(qcompile: Call, left: Call) -> None:
    answer = qcompile(*ONE, "--out", "s")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.endswith("1 training done, 0 loaded; results written to s/reproduction.md\n")
    files = left()
    names = {"results.csv", "curves.csv", "cartpole.png", "reproduction.md", "cells"}
    assert {f"s/{name}" for name in names} | {"s/cells/cartpole-svqc-paper-seed0.json"} <= {*files}
    (line,) = csv.DictReader(Path("s/results.csv").read_text().splitlines())
    cell = json.loads(Path("s/cells/cartpole-svqc-paper-seed0.json").read_text())
    assert (line["row"], line["seed"], line["episodes"]) == ("cartpole-svqc-paper", "0", "3")
    assert float(line["evaluation_mean"]) == sum(cell["evaluation"]) / 2
    assert int(line["steps"]) == sum(cell["rewards"])
    before = {name: Path(name).read_bytes() for name in files if Path(name).is_file()}

    again = qcompile(*ONE, "--out", "s", "--json")
    assert (again.code, again.err) == (0, "")
    document = again.json()
    assert (document["study"], document["trained"]) == ("paper", 0)
    assert [row["row"] for row in document["rows"]] == ["cartpole-svqc-paper"]
    assert document["rows"][0]["evaluation_mean"] == [sum(cell["evaluation"]) / 2]
    assert {Path(name) for name in document["files"]} == {
        Path(name) for name in before if "cells" not in name
    }
    assert before == {name: Path(name).read_bytes() for name in left() if Path(name).is_file()}

    more = qcompile(*ROW, *FEW, "--seeds", 2, "--workers", 1, "--out", "s")
    assert "1 training done, 1 loaded;" in more.out
    listed = qcompile(*ROW, *FEW, "--seeds", 3, "--out", "s", "--list", "--json").json()
    assert (listed[0]["seeds"], listed[0]["left"]) == (3, 1)


def test_the_page_goes_where_it_is_wanted(qcompile: Call) -> None:
    answer = qcompile(*ONE, "--out", "docs/s", "--page", "docs/p.md", "--json")
    assert answer.code == 0
    assert not Path("docs/s/reproduction.md").exists()
    assert "(s/cartpole.png)" in Path("docs/p.md").read_text()


@pytest.mark.parametrize("as_json", [False, True])
def test_an_interrupted_study_keeps_what_is_finished(
    qcompile: Call, left: Call, monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    def run_all(cells: Any, run: Any, on_result: Any, **_: Any) -> None:
        on_result(cells[0], run(cells[0]))
        raise KeyboardInterrupt

    with monkeypatch.context() as changed:
        changed.setattr("qcompile.sweep.complete.run_all", run_all)
        answer = qcompile(*ROW, *FEW, "--seeds", 2, "--out", "s", *["--json"] * as_json)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == (
        "Error: Interrupted: 1 of 2 trainings finished.\n"
        "  They are in s; the same command resumes with the others.\n"
    )
    assert left() == ["s", "s/cells", "s/cells/cartpole-svqc-paper-seed0.json"]
    more = qcompile(*ROW, *FEW, "--seeds", 2, "--out", "s", "--workers", 1, "--json")
    assert (more.code, more.json()["trained"]) == (0, 1)


def test_what_the_engine_says_goes_to_standard_error(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_all(cells: Any, run: Any, on_result: Any, *, on_loss: Any, **_: Any) -> None:
        on_loss("Workers stopped")
        on_result(cells[0], run(cells[0]))

    monkeypatch.setattr("qcompile.sweep.complete.run_all", run_all)
    answer = qcompile(*ONE, "--out", "s", "--json")
    assert (answer.code, answer.err) == (0, "Workers stopped\n")
    assert answer.json()["trained"] == 1


# What is refused, before any training.


REFUSED = {
    "study": (
        ("rainbow",),
        "Error: There is no study 'rainbow'.\n  A study is paper, or a .toml file of rows.\n",
    ),
    "figure": (
        ("--figure", "pong"),
        "Error: Unknown figure 'pong'.\n"
        "  Known: cartpole, reuse, cartpole-v0, acrobot, lunarlander.\n",
    ),
    "row": (
        ("--row", "pong"),
        "Error: There is no row whose name begins with pong.\n  --list shows the names.\n",
    ),
    "row of another figure": (
        ("--figure", "acrobot", "--row", "cartpole"),
        "Error: There is no row whose name begins with cartpole.\n  --list shows the names.\n",
    ),
    "folder": (
        ("--out", "file/s"),
        "Error: Cannot write file/s/reproduction.md.\n"
        "  file is not a folder.\n  Choose another path.\n",
    ),
    "cells": (
        ("--out", "taken"),
        "Error: Cannot write taken/cells/cell.json.\n"
        "  taken/cells is not a folder.\n  Choose another path.\n",
    ),
    "page": (
        ("--page", "file/p.md"),
        "Error: Cannot write file/p.md.\n  file is not a folder.\n  Choose another path.\n",
    ),
}


@pytest.mark.usefixtures("untrained")
@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_done_is_refused(qcompile: Call, left: Call, what: str) -> None:
    Path("file").touch()
    Path("taken").mkdir()
    Path("taken/cells").touch()
    words, text = REFUSED[what]
    answer = qcompile("study", *words)
    assert (answer.code, answer.out, answer.err) == (1, "", text)
    assert left() == ["file", "taken", "taken/cells"]


@pytest.mark.usefixtures("untrained")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("paper", "--engine", "slurm"), "'slurm' is not one of 'processes', 'dask', 'ray'"),
        (("paper", "--seeds", 0), "0 is not in the range"),
        (("paper", "--episodes", 0), "0 is not in the range"),
        (("paper", "--evaluation", 0), "0 is not in the range"),
        (("paper", "--workers", 0), "0 is not in the range"),
        (("paper", "--out", "file"), "'file' is a file"),
    ],
)
def test_wrong_usage(qcompile: Call, words: tuple[Any, ...], text: str) -> None:
    Path("file").touch()
    answer = qcompile("study", *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--address", "tcp://127.0.0.1:1"),
            "Error: The engine 'processes' takes no address, found 'tcp://127.0.0.1:1'.\n"
            "  Use --engine dask or --engine ray.\n",
        ),
        (
            ("--engine", "dask", "--address", "tcp://127.0.0.1:1"),
            "Error: There is no Dask scheduler at 'tcp://127.0.0.1:1' ",
        ),
    ],
)
def test_a_cluster_that_is_not_there(
    qcompile: Call, left: Call, words: tuple[str, ...], text: str
) -> None:
    if "dask" in words:
        pytest.importorskip("distributed")
    answer = qcompile(*ROW, *FEW, "--out", "s", *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(text)
    assert left() == []
