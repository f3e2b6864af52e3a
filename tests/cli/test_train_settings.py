"""`qcompile train`: which settings options make, the models, noise, evaluations, TensorBoard."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Call = Callable[..., Any]

PAPER = ("train", "CartPole-v1", "--preset", "paper")
SHORT = (*PAPER, "--episodes", 2, "--out", "p.json", "--force")


@pytest.fixture
def settings(qcompile: Call) -> Callable[..., dict[str, Any]]:
    """The settings that a short training with these words notes in its policy."""

    def trained(*words: object) -> dict[str, Any]:
        answer = qcompile(*SHORT, *words)
        assert (answer.code, answer.err) == (0, "")
        found: dict[str, Any] = json.loads(Path("p.json").read_text())["metadata"]["settings"]
        return found

    return trained


def test_set_changes_what_it_names_and_nothing_else(settings: Call) -> None:
    plain = settings()
    words = ("clip=0.3", "entropy = 0.5", "gae_lambda=1", "epochs=2", "minibatch=8")
    words += ("scales=0.7,2,8", "trainable_scale=true", "gradient_norm=none")
    changed = settings(*(part for word in words for part in ("-s", word)))
    assert plain | changed == changed
    assert {name: value for name, value in changed.items() if plain[name] != value} == {
        "clip": 0.3,
        "entropy": 0.5,
        "epochs": 2,
        "minibatch": 8,
        "scales": [0.7, 2.0, 8.0],
        "trainable_scale": True,
    }


def test_set_reads_lists_of_lists_and_none(settings: Call) -> None:
    words = ("--set", "scales=[[1, 2, 3, 4], 5]", "--set", "weight_spread=none")
    found = settings(*words, "--set", "mitigation=none", "--set", "steps=none")
    assert found["scales"] == [[1.0, 2.0, 3.0, 4.0], 5.0]
    assert (found["weight_spread"], found["mitigation"], found["steps"]) == (None, "none", None)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--set", "clp=1"), "Unknown setting 'clp'.\n  Did you mean clip?"),
        (("--set", "clip"), "'clip' must be NAME=VALUE, such as clip=0.2."),
        (("--set", "model=fcn"), "'model' cannot be changed as a setting"),
        (("--set", "layout=serial"), "'layout' cannot be changed as a setting"),
        (("--set", "clip=1", "--set", "clip=2"), "'clip' is set twice."),
        (
            ("--set", "reuse=3", "--reuse", "2"),
            "reuse is given twice, as an option and as a setting.",
        ),
        (("--set", "hidden=[1"), "hidden=[1 is not a JSON list: "),
        (("--evaluate-episodes", "3"), "--evaluate-episodes needs --evaluate-every."),
    ],
)
def test_wrong_usage_is_refused(
    qcompile: Call, left: Call, words: tuple[str, ...], text: str
) -> None:
    answer = qcompile(*SHORT, *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err
    assert left() == []


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (("--set", "clip=-1"), ("clip: input should be greater than 0 (found '-1')",)),
        (("--set", "clip=none"), ("clip: input should be a valid number",)),
        (("--set", "epochs=1.5"), ("epochs: input should be a valid integer",)),
        (("--set", "scales=1,-2"), ("scales.1", "greater than 0 (found '-2')")),
        (
            ("--set", "hidden=8,8"),
            ("Model 'svqc' has no setting 'hidden'", "It belongs to fcn and cnn"),
        ),
        (("--model", "fcn", "--reuse", "4"), ("Model 'fcn' has no setting 'reuse'",)),
        (("--model", "fcn", "--layout", "serial"), ("Model 'fcn' has no setting 'layout'",)),
        (
            ("--model", "mvqc", "--backend", "ibm_lima"),
            ("ibm_lima has no couplings: it cannot run a circuit on 4 qubits.", "fake_lima"),
        ),
        (("--model", "surrogate", "--shots", "9"), ("Model 'surrogate' has no setting 'shots'",)),
        (("--backend", "ibm_lim"), ("Unknown backend 'ibm_lim'", "Did you mean ibm_lima")),
        (("--set", "environments=2"), ("2 environments need a horizon.", "set horizon")),
    ],
)
def test_settings_that_do_not_fit_are_refused(
    qcompile: Call, left: Call, words: tuple[str, ...], texts: tuple[str, ...]
) -> None:
    answer = qcompile(*PAPER, "--episodes", 2, "--out", "p.pt", *words)
    assert (answer.code, answer.out) == (1, "")
    for text in texts:
        assert text in answer.err
    assert left() == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), ("ideal", None, "none")),
        (("--backend", "ideal"), ("ideal", None, "none")),
        (("--shots", "50"), ("ideal", 50, "none")),
        (("--shots", "50", "--mitigation", "readout"), ("ideal", 50, "readout")),
        (("--backend", "ibm_lima"), ("ibm_lima", 1024, "readout")),
        (("--backend", "ibm_lima", "--shots", "exact"), ("ibm_lima", None, "readout")),
        (("--backend", "ibm_lima", "--mitigation", "none"), ("ibm_lima", 1024, "none")),
        (("--backend", "ibm_lima", "--set", "shots=30"), ("ibm_lima", 30, "readout")),
    ],
)
def test_a_backend_with_noise_brings_shots_and_mitigation(
    qcompile: Call, settings: Call, words: tuple[str, ...], expected: tuple[Any, ...]
) -> None:
    found = settings(*words)
    assert (found["backend"], found["shots"], found["mitigation"]) == expected
    told = qcompile(*SHORT, *words, "--json").json()
    shots = "exact" if expected[1] is None else expected[1]
    assert (told["backend"], told["shots"], told["mitigation"]) == (
        expected[0],
        shots,
        expected[2],
    )


def test_noise_changes_what_is_learned(qcompile: Call) -> None:
    for name, words in (("exact", ()), ("shots", ("--shots", 10)), ("again", ("--shots", 10))):
        assert qcompile(*PAPER, "--episodes", 4, "--out", f"{name}/p.json", *words).code == 0
    arrays = {n: json.loads(Path(n, "p.json").read_text())["theta"] for n in ("exact", "shots")}
    assert arrays["exact"] != arrays["shots"]
    assert Path("shots/p.json").read_bytes() == Path("again/p.json").read_bytes()


@pytest.mark.parametrize(
    ("words", "parameters"),
    [
        # 4 circuits of a theta; a linear layer of 4 values and 2 outputs
        (("--model", "svqc"), 4 + 4 * 2 + 2),
        # 5 layers and a closing one, of 2 angles on each of 4 qubits; the same linear layer
        (("--model", "mvqc"), 6 * 4 * 2 + 4 * 2 + 2),
        (("--model", "fcn", "-s", "hidden=8,3"), (4 + 1) * 8 + (8 + 1) * 3 + (3 + 1) * 2),
        # kernels of 3 from 1 to 2 channels; then 2 channels of 4 features to 2 outputs
        (("--model", "cnn", "-s", "hidden=2"), (3 + 1) * 2 + (2 * 4 + 1) * 2),
    ],
)
def test_models_are_trained(
    qcompile: Call, left: Call, words: tuple[str, ...], parameters: int
) -> None:
    answer = qcompile(*PAPER, "--episodes", 2, "--out", "m.pt", "--json", *words)
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert (found["model"], found["parameters"]) == (words[1], parameters)
    assert (found["preset"], found["checkpoint"]) == ("paper", None)
    assert left() == ["m.pt"]


def test_a_surrogate_is_a_policy_that_runs(qcompile: Call) -> None:
    words = (*PAPER, "--model", "surrogate", "--episodes", 2, "--out", "p.pt")
    assert qcompile(*words).code == 0
    assert qcompile("run", "p.pt", "--episodes", 1).code == 0


def test_the_best_average_is_that_of_twenty_in_a_row(qcompile: Call) -> None:
    answer = qcompile(*PAPER, "--episodes", 30, "--out", "p.pt", "--log", "log.csv", "--json")
    rewards = np.loadtxt("log.csv", delimiter=",", skiprows=1)[:, 2]
    averages = np.convolve(rewards, np.full(20, 1 / 20), "valid")
    assert len(averages) == 11
    found = answer.json()
    assert found["last_20_mean_reward"] == pytest.approx(averages[-1])
    assert found["best_20_mean_reward"] == pytest.approx(averages.max())
    few = qcompile(*PAPER, "--episodes", 19, "--out", "few.pt", "--json").json()
    assert few["last_20_mean_reward"] == pytest.approx(rewards[:19].mean())
    assert few["best_20_mean_reward"] is None


# Evaluations.


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--backend", "ibm_lima", "--shots", 64),
        ("--model", "mvqc"),
        ("--model", "mvqc", "--backend", "fake_lima", "--shots", 64),
        ("--model", "fcn"),
    ],
)
def test_an_evaluation_is_a_run_and_leaves_the_training_alone(
    qcompile: Call, words: tuple[object, ...]
) -> None:
    """The last evaluation is of the final policy, so `qcompile run` finds the same rewards."""
    training = (*PAPER, "--episodes", 6, *words)
    assert qcompile(*training, "--out", "alone/p.json", "--log", "alone/log.csv").code == 0
    kept = ("--out", "p.json", "--log", "log.csv", "--json")
    answer = qcompile(*training, *kept, "--evaluate-every", 3, "--evaluate-episodes", 4)
    assert (answer.code, answer.err) == (0, "")
    for name in ("p.json", "log.csv"):
        assert Path(name).read_bytes() == Path("alone", name).read_bytes()
    third, last = answer.json()["evaluations"]
    steps = np.loadtxt("log.csv", delimiter=",", skiprows=1)[:, 1]
    assert (third["episode"], third["steps"]) == (3, steps[2])
    assert (last["episode"], last["steps"]) == (6, steps[5])
    run = ("--episodes", 4, "--seed", 1_000_000, "--json")
    is_noisy = "--backend" in words
    played_on = words[words.index("--backend") :] if is_noisy else ("--shots", "exact")
    played = qcompile("run", "p.json", *run, *played_on).json()
    assert last["mean_reward"] == played["mean_reward"]
    assert last["std_reward"] == played["std_reward"]


# TensorBoard.


def test_tensorboard_is_written_with_the_log(qcompile: Call) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    words = ("--out", "p.pt", "--log", "log.csv", "--tensorboard", "runs/a", "--json")
    answer = qcompile(*PAPER, "--episodes", 6, *words, "--evaluate-every", 3)
    assert (answer.code, answer.err) == (0, "")
    events = EventAccumulator("runs/a").Reload()
    rows = np.loadtxt("log.csv", delimiter=",", skiprows=1)

    def scalars(tag: str) -> list[tuple[int, float]]:
        return [(event.step, event.value) for event in events.Scalars(tag)]

    assert scalars("rollout/episode_reward") == [(int(row[1]), row[2]) for row in rows]
    averages = [rows[: i + 1, 2].mean() for i in range(6)]
    assert [value for _, value in scalars("rollout/average_20")] == pytest.approx(averages)
    assert scalars("evaluation/mean_reward") == [
        (evaluation["steps"], pytest.approx(evaluation["mean_reward"]))
        for evaluation in answer.json()["evaluations"]
    ]
    for name in ("actor_loss", "critic_loss", "entropy", "divergence", "clipped"):
        assert [step for step, _ in scalars(f"update/{name}")] == rows[:, 1].tolist()
    assert all(0 < value <= np.log(2) + 1e-6 for _, value in scalars("update/entropy"))


def test_tensorboard_goes_on_where_a_training_does(qcompile: Call, ctrl_c: Call) -> None:
    """TensorBoard shows each episode once, those beyond the checkpoint from the second run."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    words = ("--out", "p.pt", "--tensorboard", "runs", "--log", "log.csv")
    ctrl_c(4)
    assert qcompile(*PAPER, "--episodes", 6, *words, "--checkpoint", "state").code == 1
    assert qcompile("train", "CartPole-v1", *words, "--resume", "state").code == 0
    events = EventAccumulator("runs").Reload()
    rows = np.loadtxt("log.csv", delimiter=",", skiprows=1)
    seen = [(event.step, event.value) for event in events.Scalars("rollout/episode_reward")]
    assert seen == [(int(row[1]), row[2]) for row in rows]


def test_without_tensorboard_the_training_is_refused(
    qcompile: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "torch.utils.tensorboard", None)
    answer = qcompile(*SHORT, "--tensorboard", "runs", "--log", "log.csv")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: --tensorboard needs packages that are not installed.
  Install them with: pip install 'qcompile[tensorboard]'
"""
    )
    assert left() == []


def test_a_folder_that_cannot_be_made_is_refused(qcompile: Call, left: Call) -> None:
    Path("file").touch()
    answer = qcompile(*SHORT, "--tensorboard", "file/runs")
    assert (answer.code, answer.out) == (1, "")
    assert "file is not a folder." in answer.err
    assert left() == ["file"]
