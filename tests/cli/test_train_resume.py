"""`qcompile train`: checkpoints, and a training that resumes as if nothing had happened."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import torch

Call = Callable[..., Any]

PAPER = ("--preset", "paper", "--episodes", 8)
TRAININGS: dict[str, tuple[object, ...]] = {
    "an episode at a time": PAPER,
    "four environments": (
        *("--preset", "paper", "--steps", 640),
        *("-s", "environments=4", "-s", "horizon=32", "-s", "minibatch=50", "-s", "anneal=true"),
        *("-s", "scale_rewards=true"),
    ),
    "noise": (*PAPER, "--backend", "ibm_lima", "--shots", 50),
    "shots": (*PAPER, "--shots", 20),
    "Algorithm 2": (*PAPER, "-s", "pause_at=15"),
    "mvqc": (*PAPER, "--model", "mvqc"),
    "surrogate": (*PAPER, "--model", "surrogate"),
    "fcn": (*PAPER, "--model", "fcn"),
}


@pytest.fixture
def killed(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """End the training without notice when the n-th episode is counted; 0 lets it be."""

    def after(episodes: int) -> None:
        counted = 0

        @contextmanager
        def bar(*_: object, **__: object) -> Iterator[Callable[[float, str], None]]:
            def show(done: float, words: str) -> None:
                nonlocal counted
                counted += 1
                if counted == episodes:
                    raise RuntimeError("killed")

            yield show

        monkeypatch.setattr("qcompile.report.progress.progress_bar", bar)

    return after


@pytest.mark.parametrize("what", TRAININGS)
@pytest.mark.parametrize("episodes", [1, 5])
def test_an_interrupted_training_goes_on_bit_for_bit(
    qcompile: Call, ctrl_c: Call, what: str, episodes: int
) -> None:
    """Policy, settings, steps and log are, byte for byte, those of a training left alone."""
    words = ("train", "CartPole-v1", *TRAININGS[what], "--seed", 3)
    assert qcompile(*words, "--out", "whole/p.json", "--log", "whole/log.csv").code == 0
    ctrl_c(episodes)
    kept = ("--out", "p.json", "--log", "log.csv")
    assert qcompile(*words, *kept, "--checkpoint", "state").code == 1
    assert len(Path("log.csv").read_bytes()) < len(Path("whole/log.csv").read_bytes())
    answer = qcompile("train", "CartPole-v1", "--resume", "state", *kept)
    assert (answer.code, answer.err) == (0, "")
    for name in ("p.json", "log.csv"):
        assert Path(name).read_bytes() == Path("whole", name).read_bytes()


@pytest.mark.parametrize("what", ["svqc", "mvqc", "fcn"])
def test_the_advice_about_a_checkpoint_makes_its_policy(qcompile: Call, what: str) -> None:
    """The command that is named is typed as it stands."""
    words = ("train", "CartPole-v1", *PAPER, "--model", what)
    assert qcompile(*words, "--out", "p.json", "--checkpoint", "state.pt").code == 0
    advice = qcompile("run", "state.pt").err.splitlines()[1]
    command = advice.removeprefix("  This makes a policy of it: ")
    assert command == "qcompile train CartPole-v1 --resume state.pt --out POLICY.pt"
    assert qcompile(*command.split()[1:]).code == 0
    runs = [qcompile("run", file, "--episodes", 2, "--json") for file in ("p.json", "POLICY.pt")]
    one, other = (run.json()["episodes"] for run in runs)
    assert one == other


def test_evaluations_go_on_where_they_stopped(qcompile: Call, ctrl_c: Call) -> None:
    words = ("train", "CartPole-v1", *PAPER)
    often = ("--evaluate-every", 2, "--evaluate-episodes", 3, "--out", "p.pt", "--json")
    whole = qcompile(*words, *often).json()
    ctrl_c(5)
    first = qcompile(*words, *often, "--checkpoint", "state", "--force").json()
    second = qcompile("train", "CartPole-v1", "--resume", "state", *often).json()
    assert [e["episode"] for e in whole["evaluations"]] == [2, 4, 6, 8]
    assert [e["episode"] for e in first["evaluations"]] == [2, 4]
    assert first["evaluations"] + second["evaluations"] == whole["evaluations"]
    differs = {"evaluations", "preset", "checkpoint"}
    assert {k: v for k, v in second.items() if k not in differs} == {
        k: v for k, v in whole.items() if k not in differs
    }
    assert (second["preset"], second["checkpoint"]) == (None, "state")


def test_a_killed_training_goes_on_from_the_last_checkpoint(
    qcompile: Call, killed: Call, monkeypatch: pytest.MonkeyPatch, left: Call
) -> None:
    monkeypatch.setattr("qcompile.rl.watch.CHECKPOINT_SECONDS", 0.0)
    words = ("train", "CartPole-v1", *PAPER)
    assert qcompile(*words, "--out", "whole/p.json").code == 0
    killed(6)
    with pytest.raises(RuntimeError, match="killed"):
        qcompile(*words, "--out", "p.json", "--checkpoint", "state")
    assert left() == ["state", "whole", "whole/p.json"]
    saved = torch.load("state", weights_only=True)
    assert len(json.loads(saved["plain"])["collector"]["episodes"]) == 5
    killed(0)
    assert qcompile("train", "CartPole-v1", "--resume", "state", "--out", "p.json").code == 0
    assert Path("p.json").read_bytes() == Path("whole/p.json").read_bytes()


def test_checkpoints_are_ten_seconds_apart(qcompile: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock of each episode is 4 seconds on: written after the 3rd and the 6th, and at the
    end."""
    from qcompile.rl import watch

    now, saved = [0.0], []

    def tick(_: object, episodes: list[object]) -> None:
        now[0] += 4.0 * len(episodes)

    def save(trainer: Any, *_: object) -> None:
        saved.append(len(trainer.history))

    monkeypatch.setattr(watch.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(watch.EpisodeLog, "add_missing", tick)
    monkeypatch.setattr(watch, "save_checkpoint", save)
    words = ("--out", "p.pt", "--log", "log.csv", "--checkpoint", "state")
    assert qcompile("train", "CartPole-v1", *PAPER, *words).code == 0
    assert saved == [3, 6, 8]


def test_a_finished_training_is_written_once_more(qcompile: Call) -> None:
    words = ("--checkpoint", "state", "--out", "first/p.json", "--log", "first/log.csv")
    assert qcompile("train", "CartPole-v1", *PAPER, *words).code == 0
    before = Path("state").read_bytes()
    again = ("--resume", "state", "--out", "again/p.json", "--log", "again/log.csv")
    answer = qcompile("train", "CartPole-v1", *again)
    assert answer.code == 0
    assert answer.err == "The training in state is finished; only its output files are written.\n"
    assert answer.out.startswith("8 episodes, ")
    for name in ("p.json", "log.csv"):
        assert Path("first", name).read_bytes() == Path("again", name).read_bytes()
    assert torch.load("state", weights_only=True)["seed"] == 0
    assert len(Path("state").read_bytes()) == len(before)


def test_a_checkpoint_can_be_kept_elsewhere(qcompile: Call, ctrl_c: Call) -> None:
    ctrl_c(3)
    words = ("--out", "p.pt", "--checkpoint", "first")
    assert qcompile("train", "CartPole-v1", *PAPER, *words).code == 1
    before = Path("first").read_bytes()
    words = ("--resume", "first", "--checkpoint", "second", "--out", "p.pt", "--json")
    answer = qcompile("train", "CartPole-v1", *words)
    assert (answer.code, answer.json()["checkpoint"]) == (0, "second")
    assert Path("first").read_bytes() == before
    collected = json.loads(torch.load("second", weights_only=True)["plain"])["collector"]
    assert len(collected["episodes"]) == 8


@pytest.fixture
def state(qcompile: Call) -> str:
    """A checkpoint of an SVQC, trained with seed 0."""
    words = ("--preset", "paper", "--episodes", 1, "--out", "p.pt", "--checkpoint", "state")
    assert qcompile("train", "CartPole-v1", *words).code == 0
    return "state"


def test_other_versions_are_told(
    qcompile: Call, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qcompile.version import versions

    monkeypatch.setattr(
        "qcompile.rl.checkpoint.versions", lambda *names: versions(*names) | {"numpy": "0.1"}
    )
    answer = qcompile("train", "CartPole-v1", "--resume", state, "--out", "p.pt", "--json")
    assert answer.code == 0
    assert answer.json()["episodes"] == 1
    first = answer.err.splitlines()[0]
    assert first.startswith("Warning: state was made with other versions (numpy ")
    assert " then, 0.1 now). " in first
    assert first.endswith("training may differ slightly from an uninterrupted one.")


def test_what_the_checkpoint_says_too_may_be_named(qcompile: Call, state: str) -> None:
    words = ("--resume", state, "--model", "svqc", "--seed", 0, "--out", "p.pt")
    assert qcompile("train", "CartPole-v1", *words).code == 0


CONTRADICTIONS = {
    "environment": (("Acrobot-v1",), "environment 'CartPole-v1', not 'Acrobot-v1'"),
    "model": (("CartPole-v1", "--model", "fcn"), "model 'svqc', not 'fcn'"),
    "seed": (("CartPole-v1", "--seed", "4"), "seed 0, not 4"),
}


@pytest.mark.parametrize("what", CONTRADICTIONS)
def test_what_contradicts_the_checkpoint_is_refused(qcompile: Call, state: str, what: str) -> None:
    words, text = CONTRADICTIONS[what]
    answer = qcompile("train", *words, "--resume", state, "--out", "p.pt")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: Checkpoint state has {text}.\n")


@pytest.mark.parametrize(
    "words",
    [
        ("--preset", "tuned"),
        ("--layout", "parallel"),
        ("--reuse", "2"),
        ("--episodes", "9"),
        ("--steps", "9"),
        ("--set", "clip=0.3"),
        ("--backend", "ideal"),
        ("--shots", "exact"),
        ("--mitigation", "none"),
    ],
)
def test_settings_beside_a_checkpoint_are_refused(
    qcompile: Call, state: str, words: tuple[str, str]
) -> None:
    answer = qcompile("train", "CartPole-v1", "--resume", state, *words, "--out", "p.pt")
    assert (answer.code, answer.out) == (2, "")
    wanted = f"Error: {words[0]} cannot be combined with --resume: the settings come from the "
    assert answer.err == f"{wanted}checkpoint.\n"


@pytest.mark.parametrize(
    "contents",
    [b"episode,steps,reward\n1,2,3.0\n", b'{"format": "qcompile-policy-1"}', b"", b"PK\x03\x04"],
)
def test_what_is_no_checkpoint_is_refused(qcompile: Call, contents: bytes) -> None:
    Path("file").write_bytes(contents)
    answer = qcompile("train", "CartPole-v1", "--resume", "file", "--out", "p.pt")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: file is not a checkpoint: it cannot be read as ")
    assert "weights_only" not in answer.err


def test_no_file_and_a_policy_are_refused(qcompile: Call, state: str) -> None:
    answer = qcompile("train", "CartPole-v1", "--resume", "none", "--out", "p.pt")
    assert (answer.code, answer.err.splitlines()[0]) == (
        1,
        "Error: There is no checkpoint none.",
    )
    answer = qcompile("train", "CartPole-v1", "--resume", "p.pt", "--out", "q.pt")
    assert answer.code == 1
    assert "its format is 'qcompile-policy-1'" in answer.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--out", "./state"), "state must end with .pt or .json."),
        (("--out", "p.pt", "--log", "state"), "--resume and --log are the same file, state."),
        (
            ("--out", "p.pt", "--checkpoint", "p.pt"),
            "--out and --checkpoint are the same file, p.pt.",
        ),
        (
            ("--out", "p.pt", "--checkpoint", "b", "--log", "b"),
            "--checkpoint and --log are the same file, b.",
        ),
    ],
)
def test_one_file_for_two_things_is_refused(
    qcompile: Call, state: str, words: tuple[str, ...], text: str
) -> None:
    answer = qcompile("train", "CartPole-v1", "--resume", state, *words)
    assert (answer.code, answer.out) == (2, "")
    assert f"{text}\n" in answer.err
