"""No command overwrites a file that it reads, or one file with another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import qcompile as api
from qcompile.clashes import beside
from qcompile.errors import OptionError

Call = Callable[..., Any]

RUN = ("run", "tiny.json", "--episodes", 1)
LIMA = ("calibrate", "--backend", "fake_lima", "--shots", 100)
TRAIN = ("train", "CartPole-v1", "--episodes", 1)


@pytest.fixture
def nothing_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object, **__: object) -> None:
        pytest.fail("run before the files were checked")

    for name in (
        *("run.play", "plan.forecast", "calibrate.measure_qubits", "calibrate.fit_counts"),
        *("train.train_one", "train_seeds.run_all"),
    ):
        monkeypatch.setattr(f"qcompile.verbs.{name}", run)
    monkeypatch.setattr("qcompile.sweep.complete.run_all", run)


@pytest.mark.usefixtures("nothing_is_run")
@pytest.mark.parametrize(
    ("words", "pair"),
    [
        ((*LIMA, "--out", "c.csv", "--table", "c.csv"), "--out and --table"),
        ((*LIMA, "--check", "cal.csv", "--table", "cal.csv"), "--check and --table"),
        (("calibrate", "--from", "cal.csv", "--table", "cal.csv"), "--from and --table"),
        ((*RUN, "--calibration", "cal.csv", "--table", "cal.csv"), "--calibration and --table"),
        ((*RUN, "--backend", "cal.csv", "--table", "link.csv"), "--backend and --table"),
        (("run", "pol.html", "--report", "pol.html"), "the policy and --report"),
        (("run", "pol.gif", "--video", "pol.gif"), "the policy and --video"),
        (
            ("plan", "tiny.json", "--calibration", "cal.csv", "--table", "cal.csv"),
            "--calibration and --table",
        ),
        (("plan", "pol.html", "--report", "pol.html"), "the policy and --report"),
        ((*TRAIN, "--out", "p.json", "--log", "l.csv", "--table", "l.csv"), "--log and --table"),
        (
            (*TRAIN, "--out", "p.pt", "--seeds", 2, "--log", "l.csv", "--table", "l-1.csv"),
            "--log and --table",
        ),
        (
            (*TRAIN, "--out", "p.pt", "--init", "tiny.json", "--log", "tiny.json"),
            "--init and --log",
        ),
        ((*TRAIN, "--out", "p.pt", "--import", "own.py", "--log", "own.py"), "--import and --log"),
        (("study", "paper", "--page", "pg.md", "--table", "pg.md"), "--page and --table"),
        (
            ("study", "paper", "--out", "so", "--table", "so/results.csv"),
            "results.csv of --out and --table",
        ),
        (
            ("study", "paper", "--out", "so", "--table", "so/reproduction.md"),
            "reproduction.md of --out and --table",
        ),
        (
            ("evaluate", "tiny.json", "--out", "g", "--table", "g/results.csv"),
            "results.csv of --out and --table",
        ),
        (
            ("evaluate", "tiny.json", "--out", "g", "--plot", "g/tiny.png"),
            "tiny.png of --out and --plot",
        ),
        (("evaluate", "pol.html", "--report", "pol.html"), "the policy and --report"),
        (("evaluate", "--paper", "--page", "d.md", "--table", "d.md"), "--page and --table"),
        (("show", "pol.txt", "--draw", "pol.txt"), "pol.txt and --draw"),
        (("compile", "c.qasm", "-o", "c.qasm"), "FILE and --output"),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, tuple) else "",
)
def test_a_file_for_two_things_is_refused_first(
    qcompile: Call, policy: Call, words: tuple[object, ...], pair: str
) -> None:
    contents = Path(policy()).read_text()
    for name in ("pol.html", "pol.gif", "pol.txt", "cal.csv", "c.qasm", "own.py"):
        Path(name).write_text(contents)
    Path("link.csv").symlink_to("cal.csv")
    answer = qcompile(*words)
    assert (answer.code, answer.out) == (2, "")
    assert f"Error: {pair} are the same file, {words[-1]}.\n" in answer.err
    assert Path("cal.csv").read_text() == contents


@pytest.mark.parametrize("name", ["pol.gif", "link.gif"])
def test_in_python_too(policy: Call, name: str) -> None:
    Path(policy()).rename("pol.gif")
    Path("link.gif").symlink_to("pol.gif")
    with pytest.raises(OptionError, match=rf"^the policy and video are the same file, {name}\."):
        api.run("pol.gif", video=name)


def test_every_file_that_a_grid_writes_is_known(policy: Call) -> None:
    """In the folder that it has written, each file is one that nothing else may overwrite."""
    few: Any = {"shots": 16, "mitigations": "none", "episodes": 1, "workers": 1, "out": "e"}
    api.evaluate(policy(), "ibm_lima", **few, progress=False)
    written = [path for path in Path("e").rglob("*") if path.is_file()]
    assert len(written) == 5, "two cells, two files of results, a figure"
    for path in written:
        with (
            beside(writes={"table": path}),
            pytest.raises(OptionError, match="and table are the same file"),
        ):
            api.evaluate(policy(), "ibm_lima", **few, progress=False)


def test_every_file_that_a_study_writes_is_known() -> None:
    few: Any = {"rows": "cartpole-fcn", "seeds": 1, "episodes": 2, "evaluation": 1, "workers": 1}
    api.study("paper", **few, out="s", progress=False)
    written = [path for path in Path("s").rglob("*") if path.is_file()]
    assert len(written) >= 5, "a training, two files of results, a figure, the page"
    for path in written:
        with (
            beside(writes={"table": path}),
            pytest.raises(OptionError, match="and table are the same file"),
        ):
            api.study("paper", **few, out="s", progress=False)
