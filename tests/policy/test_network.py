"""Networks: their arithmetic against torch and by hand, their files, and refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import qcompile
from qcompile.errors import PolicyError
from qcompile.policy import Convolution, Dense, Network, load_circuits, load_policy, save_policy
from qcompile.policy.files import policy_file, policy_values

RNG = np.random.default_rng(5)
ACTIVATIONS = {"relu": torch.relu, "tanh": torch.tanh, "none": lambda values: values}


def by_hand() -> Network:
    """Two features, a hidden layer of three, two actions."""
    weights = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 2.0]])
    hidden = Dense(weights, np.array([0.0, -1.0, 0.5]), "relu")
    head = Dense(np.array([[1.0, 2.0, 3.0], [-1.0, 0.0, 1.0]]), np.array([0.25, -0.25]))
    return Network("mine", "CartPole-v1", [hidden, head])


def convolving(activation: str = "tanh") -> Network:
    """Six features, two convolutions of 3 and 2 channels, two dense layers, four actions."""
    shapes = [(3, 1, 3), (2, 3, 3), (5, 12), (4, 5)]
    layers: list[Any] = []
    for shape in shapes:
        form = Convolution if len(shape) == 3 else Dense
        layers.append(form(RNG.normal(size=shape), RNG.normal(size=shape[0]), activation))
    layers[-1] = replace(layers[-1], activation="none")
    return Network("slides", "Acrobot-v1", layers)


def test_a_small_network_by_hand() -> None:
    """(2, 3): relu(2, 2, 4.5) = (2, 2, 4.5); 2 + 4 + 13.5 + 0.25, and -2 + 4.5 - 0.25.

    (-1, 0.5): relu(-1, -0.5, 2.5) = (0, 0, 2.5); 7.5 + 0.25, and 2.5 - 0.25.
    """
    logits = by_hand().logits(np.array([[2.0, 3.0], [-1.0, 0.5]]))
    np.testing.assert_allclose(logits, [[19.75, 2.25], [7.75, 2.25]], atol=1e-12)
    normalised = replace(by_hand(), mean=np.array([1.0, -1.0]), std=np.array([0.5, 4.0]))
    found = normalised.logits(np.array([[2.0, 11.0], [0.5, 1.0]]))
    np.testing.assert_allclose(found, logits, atol=1e-12)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_layers_are_those_of_torch(activation: str) -> None:
    network, apply = convolving(activation), ACTIVATIONS[activation]
    observations = RNG.normal(size=(9, 6))
    values = torch.from_numpy(observations)[:, None]
    for layer in network.layers[:2]:
        weights, bias = map(torch.from_numpy, (layer.weights, layer.bias))
        values = apply(torch.nn.functional.conv1d(values, weights, bias, padding="same"))
    values = values.flatten(1)
    for layer in network.layers[2:]:
        weights, bias = map(torch.from_numpy, (layer.weights, layer.bias))
        values = torch.nn.functional.linear(values, weights, bias)
        values = apply(values) if layer is not network.layers[-1] else values
    np.testing.assert_allclose(network.logits(observations), values.numpy(), atol=1e-12)
    probabilities = torch.softmax(values, dim=1).numpy()
    np.testing.assert_allclose(network.probabilities(observations), probabilities, atol=1e-12)
    assert network.greedy(observations).tolist() == values.argmax(dim=1).tolist()
    assert (network.features, network.actions, network.parameter_count) == (6, 4, 12 + 20 + 65 + 24)


def test_decisions_follow_their_probabilities() -> None:
    """The action is the first whose cumulative probability exceeds u."""
    bias = np.log([0.2, 0.5, 0.3])
    network = Network("n", "E-v0", [Dense(np.zeros((3, 1)), bias)])
    u = np.array([0.0, 0.19, 0.21, 0.69, 0.71, 0.999])
    assert network.decide(np.zeros((6, 1)), u).tolist() == [0, 0, 1, 1, 2, 2]
    drawn = network.sample(np.zeros((4000, 1)), np.random.default_rng(0))
    shares = np.bincount(drawn, minlength=3) / 4000
    np.testing.assert_allclose(shares, [0.2, 0.5, 0.3], atol=4 * math.sqrt(0.25 / 4000))
    with pytest.raises(PolicyError, match=r"u has shape \(2,\)"):
        network.decide(np.zeros((3, 1)), np.zeros(2))


def test_it_shows_itself_in_a_line() -> None:
    text = "Network(mine, CartPole-v1, 2 layers, 17 parameters, 2 actions)"
    assert repr(by_hand()) == text
    assert "<th>network</th><th>mine</th>" in by_hand()._repr_html_()
    assert isinstance(by_hand(), qcompile.Network)


# Observations that do not fit.


@pytest.mark.parametrize(
    ("observations", "words"),
    [
        (np.zeros((2, 3)), r"shape \(2, 3\)\.\n  Network 'mine' needs \(B, 2\)\."),
        (np.zeros((2, 1)), r"shape \(2, 1\)"),
        (np.zeros(2), r"shape \(2,\)"),
        ([["a", "b"]], "not an array of real numbers: an object of type list"),
        (np.full((1, 2), 1e308), "returns logits that are not finite"),
        (np.array([[np.nan, 0.0]]), "returns logits that are not finite"),
    ],
)
def test_observations_are_checked(observations: Any, words: str) -> None:
    with pytest.raises(PolicyError, match=words):
        by_hand().logits(observations)


# Files.


@pytest.mark.parametrize("suffix", [".json", ".pt"])
@pytest.mark.parametrize("make", [by_hand, convolving])
def test_a_file_gives_it_back(tmp_path: Path, suffix: str, make: Callable[[], Network]) -> None:
    network = replace(
        make(),
        metadata={"seed": 3, "settings": {"hidden": [3]}},
        environment_kwargs={"sutton_barto_reward": True},
    )
    count = network.features
    network = replace(network, mean=RNG.normal(size=count), std=RNG.uniform(0.5, 2, count))
    save_policy(network, tmp_path / f"n{suffix}")
    again = load_policy(tmp_path / f"n{suffix}")
    assert isinstance(again, Network)
    assert policy_values(again) == policy_values(network)
    observations = RNG.normal(size=(5, count))
    np.testing.assert_array_equal(again.logits(observations), network.logits(observations))


def test_the_file_as_the_docs_have_it(tmp_path: Path) -> None:
    save_policy(by_hand(), tmp_path / "n.json")
    values = json.loads((tmp_path / "n.json").read_text())
    assert values == {
        "format": "qcompile-network-1",
        "name": "mine",
        "environment": "CartPole-v1",
        "layers": [
            {
                "type": "dense",
                "weights": [[1, 0], [0, 1], [-1, 2]],
                "bias": [0, -1, 0.5],
                "activation": "relu",
            },
            {
                "type": "dense",
                "weights": [[1, 2, 3], [-1, 0, 1]],
                "bias": [0.25, -0.25],
                "activation": "none",
            },
        ],
        "metadata": {},
    }


def test_a_pt_file_is_tensors_and_plain_values(tmp_path: Path) -> None:
    save_policy(by_hand(), tmp_path / "n.pt")
    saved = torch.load(tmp_path / "n.pt", weights_only=True)
    assert saved["layers"][0]["weights"].dtype == torch.float64
    assert saved["layers"][1]["bias"].tolist() == [0.25, -0.25]


def test_it_is_found_on_the_shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("trained").mkdir()
    save_policy(by_hand(), Path("trained/mine.json"))
    assert isinstance(qcompile.load_policy("mine"), Network)
    with pytest.raises(PolicyError, match=r"^mine is a network, not circuits: "):
        load_circuits("mine")


def changed(**changes: Any) -> dict[str, Any]:
    return policy_values(by_hand()) | changes


def layers(*changes: dict[str, Any]) -> dict[str, Any]:
    """The values with these changes to the first layers."""
    both = zip(policy_values(by_hand())["layers"], changes, strict=False)
    return changed(layers=[layer | change for layer, change in both])


KERNELS = {"type": "convolution", "weights": [[[1, 2, 3]]], "bias": [0]}
BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no layers": (changed(layers=[]), "layers: list should have at least 1 item"),
    "many layers": (changed(layers=[KERNELS] * 101), "layers: list should have at most 100 items"),
    "unknown type": (layers({}, {"type": "lstm"}), "does not match any of the expected tags"),
    "unknown activation": (layers({"activation": "gelu"}), "layers.0.dense.activation: input"),
    "unknown key": (layers({"weigths": []}), "unknown key .*\n  Did you mean weights?"),
    "unknown key of the file": (changed(reuse=2), "reuse: unknown key"),
    "jagged": (layers({"weights": [[1, 2], [3]]}), "layers.0.weights has rows of different"),
    "bias": (
        layers({"bias": [0, 0]}),
        r"layers.0.weights has shape \(3, 2\).\s+It needs",
    ),
    "inputs": (layers({}, {"weights": [[1], [2]]}), r"layers.1 has 1 inputs.\s+The previous layer"),
    "nan": (layers({"bias": [0, 0, math.nan]}), "input should be a finite number"),
    "kernel of 5": (
        changed(layers=[KERNELS | {"weights": [[[1, 2, 3, 4, 5]]]}]),
        "list should have at most 3 items",
    ),
    "no dense layer at the end": (
        changed(layers=[KERNELS]),
        "The last layer of a network must be dense",
    ),
    "convolution late": (
        changed(layers=[*policy_values(by_hand())["layers"], KERNELS, KERNELS]),
        "The last layer of a network must be dense",
    ),
    "convolution in between": (
        changed(layers=[changed()["layers"][0], KERNELS, changed()["layers"][1]]),
        "layers.1 is a convolution after a dense layer",
    ),
    "channels": (
        changed(layers=[KERNELS, {"type": "dense", "weights": [[1, 2]] * 2, "bias": [0, 0]}] * 2),
        "layers.2 is a convolution after",
    ),
    "features that no convolution gives": (
        changed(
            layers=[
                KERNELS | {"weights": [[[1, 2, 3]]] * 2, "bias": [0, 0]},
                {"type": "dense", "weights": [[1, 2, 3]], "bias": [0]},
            ]
        ),
        r"layers.1 has 3 inputs.\s+The previous layer has 2 outputs.",
    ),
    "mean": (changed(mean=[1]), r"mean has shape \(1,\).\s+It needs \(2,\)"),
    "std of 0": (changed(std=[1, 0]), "std contains a number that is not positive"),
    "arguments": (changed(environment_kwargs={"id": "x"}), "not an argument that a policy file"),
    "name": (changed(name="a\nb"), "name: must be one line of text"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, name: str) -> None:
    values, words = BAD[name]
    path = tmp_path / "n.json"
    path.write_text(json.dumps(values))
    with pytest.raises(PolicyError, match=words) as error:
        load_policy(path)
    assert str(error.value).startswith(f"{path} is not a policy file.")


def test_a_layer_that_is_too_wide_is_refused() -> None:
    wide = Convolution(np.zeros((30_000, 1, 3)), np.zeros(30_000))
    narrow = Convolution(np.zeros((1, 30_000, 3)), np.zeros(1))
    with pytest.raises(PolicyError, match=r"layers\.0 has 120,000 outputs"):
        Network("n", "E-v0", [wide, narrow, Dense(np.zeros((2, 4)), np.zeros(2))])


def test_a_file_that_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    huge = Network("n", "E-v0", [Dense(np.zeros((1000, 1000)), np.zeros(1000))])
    with pytest.raises(PolicyError, match="cannot be written to a file"):
        save_policy(huge, tmp_path / "n.pt")
    with pytest.raises(PolicyError, match="cannot be written"):
        policy_file(replace(by_hand(), metadata={"a": object()}))
    with pytest.raises(PolicyError, match="save_policy takes a Policy or a Network, and a path"):
        save_policy("mine", tmp_path / "n.pt")  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_the_network_of_the_docs_is_read(tmp_path: Path) -> None:
    """Where the pole leans by 0.1: -2 and 2 times tanh(0.1) + tanh(0.05 + 0.1)."""
    page = (Path(__file__).parents[2] / "docs" / "reference" / "policies.md").read_text()
    (block,) = [part for part in page.split("```json\n")[1:] if '"qcompile-network-1"' in part]
    (tmp_path / "balance.json").write_text(block.partition("```")[0])
    network = load_policy(tmp_path / "balance.json")
    logits = network.logits(np.array([[0.0, 0.0, 0.1, 0.0]]))
    total = math.tanh(0.1) + math.tanh(0.05 + 0.1)
    np.testing.assert_allclose(logits, [[-2 * total, 2 * total]], atol=1e-12)
