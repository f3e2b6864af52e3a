"""The options that save what a command shows: --plot, --style, --table and --draw."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]

STARTS = {".png": b"\x89PNG", ".svg": b"<svg", ".pdf": b"%PDF", ".md": b"| ", ".tex": b""}
FEW = ("--episodes", 2, "--workers", 1)


def files(*names: str) -> None:
    """Fail unless these are there, and what their suffixes say."""
    for name in map(Path, names):
        assert name.read_bytes().startswith(STARTS[name.suffix]), name
        assert name.stat().st_size > 50


@pytest.fixture
def other(policy: Callable[..., str]) -> str:
    """A second policy of the same environment, in other.json."""
    Path(policy(name="other")).rename("other.json")
    return "other.json"


def test_a_run_is_drawn_and_tabulated(policy: Callable[..., str], qcompile: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 2, "--plot", "a.svg", "--table", "a.md")
    assert answer.code == 0
    assert answer.err.splitlines()[-2:] == ["figure written to a.svg", "table written to a.md"]
    files("a.svg", "a.md")
    assert Path("a.md").read_text().splitlines()[2].startswith("| tiny | ideal | ideal | 8192 |")


def test_several_policies_stand_side_by_side(
    policy: Callable[..., str], other: str, qcompile: Call
) -> None:
    words = ("evaluate", policy(), other, "--backend", "ibm_lima", "--shots", 16, *FEW)
    answer = qcompile(*words, "--plot", "a.pdf", "--table", "a.csv", "--json")
    assert answer.code == 0
    assert json.loads(answer.out)["results"], "the document alone is on standard output"
    files("a.pdf")
    rows = [*csv.DictReader(Path("a.csv").read_text().splitlines())]
    assert [row["policy"] for row in rows] == ["tiny"] * 3 + ["other"] * 3
    means = [result["mean_reward"] for result in json.loads(answer.out)["results"]]
    assert [float(row["mean reward"]) for row in rows] == means
    again = qcompile(*words, "--plot", "a.svg", "--table", "a.tex")
    assert "0 cells played, 6 loaded" in again.out
    files("a.svg")
    drawn = Path("a.svg").read_text()
    assert all(f">{name}<" in drawn for name in ("tiny", "other", "ibm_lima"))
    assert "tiny & ibm\\_lima & readout &" in Path("a.tex").read_text(), "shots are in the title"


def test_a_plan_and_a_calibration(policy: Callable[..., str], qcompile: Call) -> None:
    answer = qcompile("plan", policy(), "--plot", "a.svg", "--table", "a.tex")
    assert answer.code == 0
    files("a.svg")
    assert "\\toprule" in Path("a.tex").read_text()
    words = ("calibrate", "--backend", "fake_lima", "--shots", 100)
    answer = qcompile(*words, "--plot", "b.pdf", "--table", "b.md")
    assert answer.code == 0
    assert answer.err == "figure written to b.pdf\ntable written to b.md\n"
    files("b.pdf", "b.md")


def test_trainings_and_studies(qcompile: Call) -> None:
    train = ("train", "CartPole-v1", "--model", "surrogate", "--episodes", 3, "--out", "a.json")
    assert qcompile(*train, "--plot", "a.svg", "--table", "a.md").code == 0
    files("a.svg", "a.md")
    study = ("study", "paper", "--row", "cartpole-svqc-paper", "--row", "acrobot-svqc-paper")
    answer = qcompile(
        *study, *FEW, "--evaluation", 2, "--seeds", 1, "--plot", "b.svg", "--table", "b.tex"
    )
    assert answer.code == 0
    files("b.svg")
    drawn = Path("b.svg").read_text()
    assert "CartPole-v1" in drawn
    assert "Acrobot-v1" in drawn, "a panel for each figure"


def test_a_style_is_laid_over_the_house_style(policy: Callable[..., str], qcompile: Call) -> None:
    Path("own.mplstyle").write_text("figure.figsize: 2, 2\n")
    words = ("run", policy(), "--episodes", 2, "--plot", "a.svg", "--style", "own.mplstyle")
    assert qcompile(*words).code == 0
    assert 'width="144pt"' in Path("a.svg").read_text(), "2 inches of 72 points"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--plot", "a.jpg"), 2, "a.jpg must end with .png, .svg or .pdf."),
        (("--table", "a.html"), 2, "a.html must end with .md, .csv or .tex."),
        (("--plot", "tiny.json/a.png"), 1, "Cannot write tiny.json/a.png."),
        (("--style", "own.mplstyle"), 2, "--style needs --plot"),
        (("--plot", "a.png", "--style", "own.mplstyle"), 1, "Cannot read own.mplstyle."),
    ],
)
def test_what_cannot_be_saved_is_refused_before_anything_is_played(
    policy: Callable[..., str],
    qcompile: Call,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    code: int,
    message: str,
) -> None:
    monkeypatch.setattr("qcompile.verbs.run.play", lambda *_, **__: pytest.fail("played"))
    answer = qcompile("run", policy(), *words)
    assert answer.code == code
    assert message in answer.err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.txt", "circuit 3, qubit"),
        ("a.svg", "circuit 3, qubit"),
        ("a.tex", "\\begin{quantikz}\n\\lstick{circuit 3, qubit"),
    ],
)
def test_circuits_are_drawn(
    policy: Callable[..., str], qcompile: Call, name: str, words: str
) -> None:
    show = ("show", policy(), "--backend", "ibm_lima")
    answer = qcompile(*show, "--draw", name, "--circuit", 3)
    assert (answer.code, answer.err) == (0, f"drawing written to {name}\n")
    assert words in Path(name).read_text()
    assert "circuit 0" not in Path(name).read_text()
    assert qcompile(*show, "--draw", name, "--json").code == 0
    assert "circuit 0 stands for 4 circuits of its shape: 0 to 3" in Path(name).read_text()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--draw", "a.png"), 2, "a.png must end with .txt, .svg or .tex."),
        (("--draw", "a.svg", "--circuit", 4), 1, "There is no circuit 4."),
        (("--circuit", 1), 2, "--circuit needs --draw"),
        (("--surrogate", "--draw", "a.svg"), 2, "--surrogate and --draw"),
    ],
)
def test_drawings_that_there_are_not(
    policy: Callable[..., str],
    qcompile: Call,
    words: tuple[object, ...],
    code: int,
    message: str,
) -> None:
    answer = qcompile("show", policy(), *words)
    assert answer.code == code
    assert message in answer.err
    assert not Path("a.svg").exists()


def test_greedy_cells_of_circuits_and_networks_say_so(
    policy: Callable[..., str], qcompile: Call
) -> None:
    """In the document, above the table, in the table that is saved, and in the figure."""
    train = ("train", "CartPole-v1", "--model", "fcn", "--episodes", 2, "--out", "net.json")
    assert qcompile(*train).code == 0
    for name, title in ((policy(), "tiny"), ("net.json", "net")):
        words = ("evaluate", name, "--greedy", "--backend", "ideal", "--shots", "exact")
        words += ("--mitigation", "none", *FEW, "--out", title, "--table", "a.tex")
        as_json = qcompile(*words, "--json")
        assert [one["greedy"] for one in json.loads(as_json.out)["results"]] == [True]
        shown = qcompile(*words)
        assert f"{title} in CartPole-v1, 2 episodes" in shown.out
        assert ", greedy" in shown.out.splitlines()[0]
        assert "\n% CartPole-v1, 2 episodes, greedy" in Path("a.tex").read_text()
