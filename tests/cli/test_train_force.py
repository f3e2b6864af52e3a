"""`qcompile train`: files that are there are kept, unless --force is said or they are its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]

SHORT = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 2)


@pytest.mark.parametrize(
    ("option", "name"), [("--out", "p.pt"), ("--out", "p.json"), ("--checkpoint", "state")]
)
def test_a_file_that_is_there_is_kept(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch, option: str, name: str
) -> None:
    Path(name).write_text("good")
    words = (*SHORT, *(() if option == "--out" else ("--out", "q.pt")), option, name)
    with monkeypatch.context() as patch:
        patch.setattr("qcompile.rl.ppo.Trainer.train", lambda *_: pytest.fail("trained"))
        answer = qcompile(*words)
    assert (answer.code, answer.out) == (1, "")
    advice = f"hoose another with {option}, or overwrite it with --force.\n"
    why = "C" if option == "--out" else "It can be resumed with --resume: c"
    assert answer.err == f"Error: {name} already exists.\n  {why}{advice}"
    assert Path(name).read_text() == "good"
    assert qcompile(*words, "--force").code == 0
    assert Path(name).read_bytes() != b"good"


def test_a_resumed_training_overwrites_its_own_policy(qcompile: Call, ctrl_c: Call) -> None:
    """The command that Ctrl-C advises works as it is typed."""
    words = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 6)
    ctrl_c(3)
    answer = qcompile(*words, "--out", "p.pt", "--checkpoint", "state")
    advice = answer.err.splitlines()[-1]
    assert advice == "  Resume with: qcompile train CartPole-v1 --resume state --out p.pt"
    before = Path("p.pt").read_bytes()
    assert qcompile(*advice.partition("qcompile ")[2].split()).code == 0
    assert Path("p.pt").read_bytes() != before
    assert qcompile(*advice.partition("qcompile ")[2].split()).code == 0


def test_the_advice_continues_the_log_and_the_scalars(qcompile: Call, ctrl_c: Call) -> None:
    words = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 6)
    kept = ("--log", "a.csv", "--tensorboard", "board", "--checkpoint", "state", "--out", "p.pt")
    ctrl_c(3)
    advice = qcompile(*words, *kept).err.splitlines()[-1]
    assert advice.endswith("--resume state --out p.pt --log a.csv --tensorboard board")
    assert len(Path("a.csv").read_text().splitlines()) < 7
    assert qcompile(*advice.partition("qcompile ")[2].split()).code == 0
    assert len(Path("a.csv").read_text().splitlines()) == 7  # and its header
    assert len([*Path("board").rglob("*tfevents*")]) == 2


@pytest.mark.parametrize(
    "other",
    [
        ("--seed", 1),
        ("--set", "clip=0.3"),
        ("--episodes", 3),
    ],
)
def test_a_resumed_training_keeps_what_is_another_training_s(
    qcompile: Call, other: tuple[object, ...]
) -> None:
    assert qcompile(*SHORT, "--out", "p.pt", "--checkpoint", "state").code == 0
    words = [*SHORT, *other] if other[0] != "--episodes" else [*SHORT[:-2], *other]
    assert qcompile(*words, "--out", "other.pt").code == 0
    before = Path("other.pt").read_bytes()
    resumed = ("train", "CartPole-v1", "--resume", "state", "--out", "other.pt")
    answer = qcompile(*resumed)
    assert answer.code == 1
    assert answer.err.startswith("Error: other.pt already exists.\n")
    assert Path("other.pt").read_bytes() == before
    assert qcompile(*resumed, "--force").code == 0


def test_a_resumed_training_keeps_what_is_no_policy(qcompile: Call) -> None:
    assert qcompile(*SHORT, "--out", "p.pt", "--checkpoint", "state").code == 0
    Path("notes.json").write_text("mine")
    Path("copy").write_bytes(Path("state").read_bytes())
    for words in (("--out", "notes.json"), ("--out", "p.pt", "--checkpoint", "copy")):
        answer = qcompile("train", "CartPole-v1", "--resume", "state", *words)
        assert answer.code == 1
        assert "already exists." in answer.err
    assert Path("notes.json").read_text() == "mine"
