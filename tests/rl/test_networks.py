"""The classical baselines: sizes, arithmetic and initial parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from scipy import stats

from qcompile.errors import TrainingError
from qcompile.rl.models import make_model
from qcompile.rl.settings import Settings

FCN = Settings(model="fcn", steps=1, hidden=(16, 32, 64, 32))
CNN = Settings(model="cnn", steps=1, hidden=(5, 2, 4, 2))


def make(settings: Settings, features: int = 4, outputs: int = 2, seed: int = 0) -> Any:
    return make_model(settings, features, outputs, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(
    ("settings", "features", "outputs", "count"),
    [
        (FCN, 4, 2, 5 * 16 + 17 * 32 + 33 * 64 + 65 * 32 + 33 * 2),
        (FCN, 4, 2, 4882),
        (FCN, 8, 4, 9 * 16 + 17 * 32 + 33 * 64 + 65 * 32 + 33 * 4),
        (replace(FCN, hidden=()), 4, 2, 5 * 2),
        # a channel has 3 weights for each channel before it, and a bias
        (CNN, 4, 2, 5 * 4 + 2 * 16 + 4 * 7 + 2 * 13 + 2 * (2 * 4 + 1)),
        (CNN, 8, 4, 20 + 32 + 28 + 26 + 4 * (2 * 8 + 1)),
        (replace(CNN, hidden=(5, 2, 4, 2, 3)), 6, 3, 106 + 3 * 7 + 3 * (3 * 6 + 1)),
    ],
)
def test_parameters_are_counted_by_hand(
    settings: Settings, features: int, outputs: int, count: int
) -> None:
    model = make(settings, features, outputs)
    assert sum(p.numel() for p in model.parameters()) == count
    assert model.policy("n", "e", {}).parameter_count == count


ACTIVATIONS: dict[str, Callable[[Any], Any]] = {"relu": lambda a: np.maximum(a, 0), "tanh": np.tanh}


def arrays(model: torch.nn.Module) -> list[np.ndarray]:
    return [p.detach().double().numpy() for p in model.parameters()]


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_a_fully_connected_network_is_its_matrices(activation: str) -> None:
    model = make(replace(FCN, activation=activation), 4, 3)
    observations = np.random.default_rng(0).normal(size=(7, 4))
    values, numbers = observations, arrays(model)
    for weight, bias in zip(numbers[:-2:2], numbers[1:-2:2], strict=True):
        values = ACTIVATIONS[activation](values @ weight.T + bias)
    expected = values @ numbers[-2].T + numbers[-1]
    found = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_a_convolutional_network_slides_over_the_features(activation: str) -> None:
    """Position i of a channel sees i - 1, i and i + 1 of those before it; beyond the row is 0."""
    model = make(replace(CNN, activation=activation), 6, 3)
    observations = np.random.default_rng(1).normal(size=(7, 6))
    values, numbers = observations[:, None, :], arrays(model)
    for weight, bias in zip(numbers[:-2:2], numbers[1:-2:2], strict=True):
        out = np.tile(bias[None, :, None], (7, 1, 6))
        for i in range(6):
            for k in range(3):
                if 0 <= i + k - 1 < 6:
                    out[:, :, i] += values[:, :, i + k - 1] @ weight[:, :, k].T
        values = ACTIVATIONS[activation](out)
    expected = values.reshape(7, -1) @ numbers[-2].T + numbers[-1]
    found = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("settings", [FCN, CNN], ids=["fcn", "cnn"])
def test_the_same_generator_makes_the_same_model(settings: Settings) -> None:
    first, again, other = (make(settings, seed=s) for s in (5, 5, 6))
    pairs = zip(arrays(first), arrays(again), arrays(other), strict=True)
    for one, two, three in pairs:
        np.testing.assert_array_equal(one, two)
        assert (one != three).all()


def test_nothing_is_drawn_from_torch_s_own_generator() -> None:
    """Random draws must not depend on earlier draws."""
    torch.manual_seed(1)
    first = make(FCN)
    torch.manual_seed(2)
    for one, two in zip(arrays(first), arrays(make(FCN)), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(
    ("settings", "inputs"),
    [
        (replace(FCN, hidden=(400, 300)), [20, 400, 300]),
        (replace(CNN, hidden=(100, 60)), [3, 300, 60 * 20]),
    ],
    ids=["fcn", "cnn"],
)
def test_first_numbers_are_uniform_as_torch_draws_them(
    settings: Settings, inputs: list[int]
) -> None:
    """Weights and biases within 1 / sqrt(inputs of the layer), uniform by Kolmogorov-Smirnov."""
    numbers = arrays(make(settings, 20, 50))
    for weight, bias, count in zip(numbers[::2], numbers[1::2], inputs, strict=True):
        assert weight[0].size == count
        limit = count**-0.5
        for array in (weight, bias):
            assert np.abs(array).max() <= limit * (1 + 1e-6)
            law = stats.uniform(-limit, 2 * limit)
            assert stats.kstest(array.ravel(), law.cdf).pvalue > 1e-3


@pytest.mark.parametrize("settings", [FCN, CNN], ids=["fcn", "cnn"])
def test_weight_spread_is_the_deviation_of_the_last_layer(settings: Settings) -> None:
    """Normal with deviation 0.01 and without bias; the other layers are as they were."""
    usual = arrays(make(settings, 40, 200))
    narrow = arrays(make(replace(settings, weight_spread=0.01), 40, 200))
    for one, two in zip(usual[:-2], narrow[:-2], strict=True):
        np.testing.assert_array_equal(one, two)
    assert not narrow[-1].any()
    assert stats.kstest(narrow[-2].ravel() / 0.01, stats.norm.cdf).pvalue > 1e-3


# As policies.


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("hidden", [(), (5,), (6, 4, 3)])
@pytest.mark.parametrize("settings", [FCN, CNN], ids=["fcn", "cnn"])
def test_the_policy_has_the_logits_of_the_model(
    settings: Settings, hidden: tuple[int, ...], activation: str
) -> None:
    model = make(replace(settings, hidden=hidden, activation=activation), 6, 3)
    network = model.policy("n", "Acrobot-v1", {"seed": 1})
    observations = np.random.default_rng(2).normal(size=(50, 6), scale=3)
    expected = model(torch.tensor(observations)).detach().numpy()
    np.testing.assert_allclose(network.logits(observations), expected, atol=1e-5)
    assert (network.features, network.actions, network.metadata) == (6, 3, {"seed": 1})


@pytest.mark.parametrize("settings", [FCN, CNN], ids=["fcn", "cnn"])
def test_a_model_takes_the_numbers_of_a_network(settings: Settings) -> None:
    first, other = (make(settings, 6, 3, seed) for seed in (1, 2))
    other.take(first.policy("n", "Acrobot-v1", {}))
    for ours, theirs in zip(other.parameters(), first.parameters(), strict=True):
        assert torch.equal(ours, theirs)
        assert ours.requires_grad


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (replace(FCN, hidden=(16,)), r"n are dense, 6 to 16 \(relu\); dense, 16 to 3\."),
        (replace(FCN, activation="tanh"), r"n are dense, 6 to 16 \(tanh\); "),
        (CNN, r"n are convolution of width 3, 1 to 5 channels \(relu\); "),
    ],
)
def test_a_model_takes_no_other_layers(settings: Settings, words: str) -> None:
    network = make(settings, 6, 3).policy("n", "Acrobot-v1", {})
    with pytest.raises(TrainingError, match=words):
        make(FCN, 6, 3).take(network)
