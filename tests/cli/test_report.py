"""`--report`: a page beside the answer of a command, checked before anything is played."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import click
import pytest

from qcompile.cli.run import command as run_command
from qcompile.cli.typed_command import _parts
from qcompile.deploy.deployment import Deployment

Call = Callable[..., Any]


@pytest.fixture
def unplayed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is played."""

    def play(*_: Any, **__: Any) -> None:
        pytest.fail("played before the files were checked")

    monkeypatch.setattr("qcompile.verbs.run.play", play)


def test_a_page_and_a_document(qcompile: Call, policy: Call, left: Call) -> None:
    words = ("run", policy(), "--episodes", 2, "--json", "--report", "out/a.html")
    answer = qcompile(*words)
    assert (answer.code, answer.err) == (0, "report written to out/a.html\n")
    assert answer.json()["policy"] == "tiny"
    assert left() == ["out", "out/a.html", "tiny.json"]
    page = unescape(Path("out/a.html").read_text())
    assert "qcompile run tiny.json --episodes 2 --json --report a.html" in page
    mean = answer.json()["mean_reward"]
    assert f'<p class="value">{mean:.1f}</p>' in page


def test_the_same_run_gives_the_same_page(qcompile: Call, policy: Call) -> None:
    """But for the times that it took and when it was written."""
    pages = []
    for _ in range(2):
        assert qcompile("run", policy(), "--episodes", 2, "--report", "a.html").code == 0
        lines = Path("a.html").read_text().splitlines()
        pages.append([line for line in lines if not re.search("UTC|<dt>played</dt>", line)])
    assert pages[0] == pages[1]


@pytest.mark.usefixtures("unplayed")
def test_what_is_no_page_is_refused_first(qcompile: Call, policy: Call, left: Call) -> None:
    answer = qcompile("run", policy(), "--report", "a.pdf")
    assert answer.code == 2
    assert "a.pdf must end with .html." in answer.err
    assert left() == ["tiny.json"]


@pytest.mark.usefixtures("unplayed")
def test_a_page_that_cannot_be_written_is_refused_first(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--report", "tiny.json/a.html")
    assert answer.code == 1
    assert "Cannot write tiny.json/a.html." in answer.err


@pytest.mark.usefixtures("nothing_is_measured")
def test_a_page_takes_no_other_file_of_the_command(qcompile: Call) -> None:
    words = ("calibrate", "--backend", "ibm_lima", "--out", "a.html", "--report", "./a.html")
    answer = qcompile(*words)
    assert answer.code == 2
    assert "--out and --report are the same file, a.html." in answer.err


def test_an_interrupted_run_says_so(
    qcompile: Call, policy: Call, ctrl_c: Callable[[int], None]
) -> None:
    """The page and the table say what the terminal says, and before everything else."""
    ctrl_c(2)
    answer = qcompile("run", policy(), "--episodes", 5, "--report", "a.html", "--table", "a.md")
    assert answer.code == 1
    first, second, *_ = answer.err.split("Error: ")[1].splitlines()
    assert first == "Interrupted: 2 of 5 episodes finished."
    words = f"{first} {second.strip()}"
    header, _, _ = Path("a.html").read_text().partition("</header>")
    assert f'<p class="warning"><strong>Note</strong> {words}</p>' in unescape(header)
    assert f"\n\n{words}\n" in Path("a.md").read_text()
    assert "| 2 of 5 |" in Path("a.md").read_text()


def test_an_interrupted_run_without_an_episode_keeps_earlier_files(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C in the third step."""
    steps: list[int] = []

    def act(*arguments: Any) -> Any:
        steps.append(1)
        if len(steps) > 2:
            raise KeyboardInterrupt
        return played(*arguments)

    played = Deployment.act
    monkeypatch.setattr(Deployment, "act", act)
    names = {"--report": "a.html", "--table": "a.md", "--plot": "a.svg", "--video": "a.gif"}
    for name in names.values():
        Path(name).write_text("earlier")
    answer = qcompile("run", policy(), *(word for pair in names.items() for word in pair))
    assert answer.code == 1
    assert answer.err.splitlines()[:3] == [
        "no film: no episode was finished, and a.gif is kept",
        "nothing written: no episode was finished",
        "Error: Interrupted: 0 of 20 episodes finished.",
    ]
    assert {Path(name).read_text() for name in names.values()} == {"earlier"}


def test_cut_and_equal_episodes_are_said_first(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(), "--episodes", 5, "--max-steps", 4, "--report", "a.html")
    answer = qcompile(*words, "--table", "a.md", "--json")
    assert answer.code == 0
    values = answer.json()
    header, _, _ = unescape(Path("a.html").read_text()).partition("</header>")
    table = Path("a.md").read_text().replace("\\", "")
    for text in (
        # an upper 95 % bound for five equal ones: the fifth root of 5 % is 0.549
        "All equal: up to 45 % of all episodes may still have other rewards",
        "Cut: 5 episodes after 4 steps",
        "Uncut: mean reward ",
    ):
        assert text in header
        assert text in table
    qcompile(*words, "--table", "a.csv")
    (row,) = csv.DictReader(Path("a.csv").read_text().splitlines())
    assert row["cut"] == "5"
    assert float(row["mean uncut"]) == values["mean_reward_completed"]
    ends = ("95 % interval uncut, low", "95 % interval uncut, high")
    assert [float(row[end]) for end in ends] == values["ci95_completed"]


def test_a_page_names_files_without_their_folders(
    qcompile: Call, policy: Call, calibration: str
) -> None:
    """Whatever the option; texts that only look like paths stay."""
    folder = Path("clients/acme-secret")
    folder.mkdir(parents=True)
    tiny = Path(policy(name="see https://a.b/c and /d/e ^~\\{}")).rename(folder / "tiny.json")
    held = Path(calibration).rename(folder / "lima.json")
    few = ("--episodes", 2, "--shots", 16)
    commands = {
        "run": (tiny, "--backend", held, "--calibration", held, *few, f"--table={folder}/a.md"),
        "evaluate": (
            *(tiny, "--backend", f"fake_lima,{held}", "--calibration", held, *few),
            *("--mitigation", "readout", "--workers", 1, "--out", folder / "e"),
        ),
        "calibrate": (
            *("--backend", "fake_lima", "--check", held, "--out", folder / "new.json"),
            *("--max-age-hours", 1e-9),
        ),
    }
    for verb, words in commands.items():
        file = folder / f"{verb}.html"
        answer = qcompile(verb, *words, "--report", file)
        assert "report written" in answer.err, answer.err
        page = unescape(file.read_text())
        assert "acme" not in page, verb
        assert f"{verb}.html" in page
        assert "lima.json" in page
    for verb in ("run", "evaluate"):
        page = unescape((folder / f"{verb}.html").read_text())
        assert "see https://a.b/c and /d/e ^~\\{}" in page


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["run", "a/p.pt"], [["run", "p.pt"]]),
        (
            ["--traceback", "run", "--split", "--account", "ada", "--instance=crn:v1:a/42", "p.pt"],
            [
                ["--traceback", "run"],
                ["--split"],
                ["--account", "..."],
                ["--instance=...", "p.pt"],
            ],
        ),
        (
            ["run", "--env", "a=--shots /x/y", "--env", "--", "--", "-/p.pt"],
            [["run"], ["--env", "a=--shots /x/y"], ["--env", "--", "--", "p.pt"]],
        ),
        (["run", "--import", "/home/ada/e.py"], [["run"], ["--import", "e.py"]]),
    ],
)
def test_the_command_of_a_page(words: list[str], parts: list[list[str]]) -> None:
    """Options with their values, whatever these look like; paths by their names."""
    assert _parts(click.Context(run_command), words) == parts


def test_a_grid_has_a_page(qcompile: Call, policy: Call) -> None:
    few = ("--shots", 16, "--mitigation", "none", "--episodes", 2, "--workers", 1, "--out", "e")
    answer = qcompile("evaluate", policy(), *few, "--report", "a.html", "--json")
    assert answer.code == 0
    page = unescape(Path("a.html").read_text())
    for cell in answer.json()["results"]:
        assert f"<td>{cell['mitigation']}</td>" in page
        assert f"{cell['mean_reward']:.1f} ± {cell['std_reward']:.1f}" in page


def test_a_calibration_that_no_longer_holds_has_a_page(qcompile: Call, calibration: str) -> None:
    words = ("calibrate", "--backend", "fake_lima", "--check", calibration, "--seed", 2)
    answer = qcompile(*words, "--max-age-hours", 1e-9, "--report", "a.html")
    assert answer.code == 1
    page = Path("a.html").read_text()
    assert f"{calibration} no longer holds." in page
    assert 'id="check"' in page
