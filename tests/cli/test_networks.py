"""Networks at the command line: trained, shown, played, evaluated, refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

Call = Callable[..., Any]

TRAIN = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 3, "--model")


@pytest.fixture
def net(qcompile: Call) -> str:
    """The file of a network that was trained for three episodes."""
    assert qcompile(*TRAIN, "fcn", "--out", "net.pt").code == 0
    return "net.pt"


@pytest.mark.parametrize("model", ["fcn", "cnn"])
@pytest.mark.parametrize("suffix", [".pt", ".json"])
def test_what_is_trained_is_played(
    qcompile: Call, left: Call, run_keys: set[str], model: str, suffix: str
) -> None:
    file = f"net{suffix}"
    assert qcompile(*TRAIN, model, "--out", file).code == 0
    assert left() == [file]
    answer = qcompile("run", file, "--episodes", 3, "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert set(found) == run_keys
    assert (found["policy"], found["kind"], found["shots"]) == ("net", "ideal", "exact")
    assert (found["circuits_per_step"], found["executions"], found["jobs"]) == (0, 0, 0)
    assert len(found["episodes"]) == 3


def test_the_file_has_the_numbers_that_were_trained(qcompile: Call) -> None:
    """The actor of the checkpoint, layer by layer; and the settings, in its metadata."""
    words = (*TRAIN, "fcn", "-s", "hidden=3", "--out", "net.json", "--checkpoint", "state")
    assert qcompile(*words).code == 0
    actor = torch.load("state", weights_only=True)["tensors"]["actor"]
    values = json.loads(Path("net.json").read_text())
    found = [layer[key] for layer in values["layers"] for key in ("weights", "bias")]
    assert found == [tensor.double().tolist() for tensor in actor.values()]
    assert [layer["activation"] for layer in values["layers"]] == ["relu", "none"]
    assert values["metadata"]["settings"]["hidden"] == [3]


def test_a_run_in_words(qcompile: Call, net: str) -> None:
    answer = qcompile("run", net, "--episodes", 2, "--max-steps", 4, "--greedy")
    assert (answer.code, answer.err) == (0, "")
    assert "net in CartPole-v1 on ideal (ideal simulation)" in answer.out
    assert "a network, without circuits" in answer.out
    assert "mitigation" not in answer.out


def test_a_film_of_a_network(qcompile: Call, net: str) -> None:
    answer = qcompile("run", net, "--episodes", 1, "--max-steps", 3, "--video", "film.gif")
    assert (answer.code, answer.err) == (0, "film of the first episode in film.gif\n")
    assert Path("film.gif").stat().st_size > 0


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("--shots", 100), "--shots"),
        (("--backend", "ibm_lima"), "--backend ibm_lima"),
        (("--mitigation", "readout", "--level", 0), "--level or --mitigation"),
        (("--predistort",), "--predistort"),
        (("--copies", 2), "--copies"),
    ],
)
def test_options_of_circuits_are_refused(
    qcompile: Call, net: str, words: tuple[object, ...], what: str
) -> None:
    answer = qcompile("run", net, *words)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.splitlines() == [
        f"Error: net is a network, not circuits: it does not accept {what}.",
        "  A network plays exactly, on `ideal`: nothing is compiled or measured.",
    ]


@pytest.mark.parametrize(
    "words",
    [
        ("plan", "net.pt"),
        ("export", "net.pt"),
        ("show", "net.pt", "--surrogate"),
        ("calibrate", "--backend", "ibm_lima", "--policy", "net.pt", "--out", "c.json"),
        ("run", "net.pt", "--backend", "ibm_lima", "--live", "--max-qpu-seconds", 5, "--yes"),
    ],
    ids=lambda words: words[0],
)
def test_where_circuits_are_needed_it_is_refused(
    qcompile: Call, net: str, left: Call, words: tuple[object, ...]
) -> None:
    answer = qcompile(*words)
    assert (answer.code, answer.out) == (1, "")
    first, second = answer.err.splitlines()
    assert first.endswith(" is a network, not circuits: there is nothing to compile or measure.")
    assert second == "  `qcompile run` and `qcompile evaluate` play it, on `ideal`."
    assert left() == [net]


def test_a_twin_is_not_validated_with_a_network(qcompile: Call, net: str, calibration: str) -> None:
    answer = qcompile("validate", calibration, "--policy", net)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: net.pt is a network, not circuits")


def test_its_layers_are_shown(qcompile: Call) -> None:
    """Two channels of three numbers and a bias; four features of each go to two actions."""
    assert qcompile(*TRAIN, "cnn", "-s", "hidden=2", "--out", "net.pt").code == 0
    answer = qcompile("show", "net.pt")
    head = "net for CartPole-v1: a network of 2 layers, 4 features, 2 actions, 26 trained numbers"
    assert answer.out.splitlines()[0] == head
    rows = [line.split() for line in answer.out.splitlines() if line.strip()[:1].isdigit()]
    assert rows == [
        ["0", "convolution", "1", "2", "relu", "8"],
        ["1", "dense", "8", "2", "none", "18"],
    ]
    values = qcompile("show", "net.pt", "--json").json()
    assert values["policy"]["parameters"] == sum(layer["parameters"] for layer in values["layers"])
    refused = qcompile("show", "net.pt", "--backend", "ibm_lima", "--level", 2)
    assert refused.code == 2
    assert "it does not accept --backend or --level." in refused.err


def test_a_grid_has_a_network_beside_circuits(qcompile: Call, net: str, policy: Call) -> None:
    grid = ("--backend", "ibm_lima", "--shots", 16, "--mitigation", "none", "--episodes", 3)
    answer = qcompile("evaluate", net, policy(), *grid, "--workers", 1, "--json")
    assert answer.code == 0
    assert answer.err.startswith(
        "Left out: net except on ideal with exact expectations: a network has no circuits.\n"
    )
    cells = answer.json()["results"]
    found = [(cell["policy"], cell["backend"], cell["shots"]) for cell in cells]
    assert found == [
        ("net", "ideal", "exact"),
        ("tiny", "ideal", "exact"),
        ("tiny", "ibm_lima", 16),
    ]
    run = qcompile("run", net, "--episodes", 3, "--json").json()
    assert cells[0]["episodes"] == run["episodes"]
    assert Path("evaluation/net.png").exists()
    again = qcompile("evaluate", net, policy(), *grid, "--workers", 1)
    assert "0 cells played, 3 loaded" in again.out


def test_nothing_is_left_out_where_nothing_else_is_asked(qcompile: Call, net: str) -> None:
    grid = ("--backend", "ideal", "--shots", "exact", "--mitigation", "none", "--episodes", 2)
    answer = qcompile("evaluate", net, *grid, "--workers", 1)
    assert answer.code == 0
    assert "Left out" not in answer.err + answer.out
    assert "net in CartPole-v1, 2 episodes\n" in "\n".join(map(str.rstrip, answer.out.split("\n")))


def test_a_model_that_no_file_holds_is_refused_before_it_is_trained(
    qcompile: Call, left: Call
) -> None:
    answer = qcompile(*TRAIN, "fcn", "-s", "hidden=1200,1200", "--out", "net.pt")
    assert (answer.code, answer.out, left()) == (1, "", [])
    assert "cannot be written to a file" in answer.err
