"""The entangling circuit against Qiskit's statevector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from qiskit import QuantumCircuit
from qiskit.quantum_info import Pauli, Statevector

from qcompile.errors import TrainingError
from qcompile.rl.models import CircuitModel, make_model
from qcompile.rl.settings import Settings

BASE = Settings(model="mvqc", steps=1, theta_spread_rad=2 * np.pi)


def make(settings: Settings, features: int, outputs: int = 2, seed: int = 0) -> CircuitModel:
    return CircuitModel(features, outputs, settings, torch.Generator().manual_seed(seed))


def angles(model: CircuitModel, features: int) -> np.ndarray:
    """theta as (layers + 1, features, 2)."""
    return model.theta.detach().double().numpy().reshape(-1, features, 2)


def by_qiskit(
    observations: np.ndarray, theta: np.ndarray, scales: np.ndarray, pairs: list[tuple[int, int]]
) -> np.ndarray:
    """<Z> of every qubit: observations (B, n), theta (layers + 1, n, 2), scales (layers, n)."""
    rows = []
    for observation in observations:
        n = len(observation)
        circuit = QuantumCircuit(n)
        for layer in range(len(theta)):
            for q in range(n):
                circuit.ry(theta[layer, q, 0], q)
                circuit.rz(theta[layer, q, 1], q)
            if layer == len(scales):
                break
            for pair in pairs:
                circuit.cz(*pair)
            for q in range(n):
                x = np.arctan(observation[q] * scales[layer, q])
                circuit.ry(x, q)
                circuit.rz(x, q)
        state = Statevector(circuit)
        rows.append([state.expectation_value(Pauli("Z"), [q]).real for q in range(n)])
    return np.array(rows)


PAIRS = {
    1: [],
    2: [(0, 1)],
    3: [(0, 1), (1, 2), (2, 0)],
    4: [(0, 1), (1, 2), (2, 3), (3, 0)],
    5: [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)],
    6: [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)],
}


@pytest.mark.parametrize("layers", [1, 3])
@pytest.mark.parametrize("features", PAIRS)
def test_expectations_are_those_of_qiskit(features: int, layers: int) -> None:
    """Single precision over some tens of gates: errors stay near 1e-6."""
    rng = np.random.default_rng(10 * features + layers)
    scales = rng.uniform(0.3, 4.0, (layers, features))
    settings = replace(BASE, scales=tuple(map(tuple, scales.tolist())))
    model = make(settings, features, seed=layers)
    observations = rng.normal(size=(5, features))
    found = model.expectation(torch.tensor(observations, dtype=torch.float32))
    theta = angles(model, features)
    assert len(theta) == layers + 1
    expected = by_qiskit(observations, theta, scales, PAIRS[features])
    np.testing.assert_allclose(found.detach().numpy(), expected, atol=5e-6)
    assert np.ptp(expected, axis=0).min() > 0.01, "nothing depends on the observation"


def test_one_scale_serves_all_features_of_its_layer() -> None:
    model = make(replace(BASE, scales=(0.5, 3.0)), 3)
    observations = np.random.default_rng(0).normal(size=(4, 3))
    scales = np.array([[0.5] * 3, [3.0] * 3])
    expected = by_qiskit(observations, angles(model, 3), scales, PAIRS[3])
    found = model.expectation(torch.tensor(observations, dtype=torch.float32))
    np.testing.assert_allclose(found.detach().numpy(), expected, atol=5e-6)


def test_outputs_are_a_linear_layer_on_the_expectations() -> None:
    """Column c * n + q is copy c of qubit q."""
    model = make(replace(BASE, scales=(1.0, 2.0), reuse=3), 4, 3)
    with torch.no_grad():
        model.head.bias += torch.tensor([0.1, -0.2, 0.3])
    observations = torch.randn(6, 4, generator=torch.Generator().manual_seed(1))
    z = np.tile(model.expectation(observations).detach().numpy(), 3)
    expected = z @ model.head.weights.detach().numpy().T + [0.1, -0.2, 0.3]
    np.testing.assert_allclose(model(observations).detach().numpy(), expected, atol=1e-6)


def test_the_gradient_is_that_of_qiskit_s_finite_differences() -> None:
    """Central differences in double precision; the model's is single."""
    model = make(replace(BASE, scales=(0.7, 2.0), trainable_scale=True), 3)
    rng = np.random.default_rng(5)
    observations, mix = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    found = model.expectation(torch.tensor(observations, dtype=torch.float32))
    (found * torch.tensor(mix)).sum().backward()
    theta = angles(model, 3)
    logs = model.log_scale.detach().double().numpy().reshape(2, 3)
    step = 1e-4
    for numbers, parameter in ((theta, model.theta), (logs, model.log_scale)):
        assert parameter.grad is not None
        gradient = parameter.grad.numpy().reshape(numbers.shape)
        for index in np.ndindex(numbers.shape):
            losses, first = [], numbers[index]
            for sign in (1, -1):
                numbers[index] = first + sign * step
                z = by_qiskit(observations, theta, np.exp(logs), PAIRS[3])
                losses.append((z * mix).sum())
            numbers[index] = first
            assert gradient[index] == pytest.approx((losses[0] - losses[1]) / (2 * step), abs=5e-6)


@pytest.mark.parametrize(
    ("features", "outputs", "changes", "count"),
    [
        # 5 layers on 4 qubits: 6 * 4 * 2 angles; 2 outputs from 4 values and a bias
        (4, 2, {"scales": (1.0,) * 5, "reuse": 16}, 48 + 10),
        (4, 2, {"scales": (1.0,) * 5, "reuse": 16, "trainable_scale": True}, 48 + 20 + 10),
        (8, 4, {"scales": (1.0,) * 5}, 96 + 36),
        (2, 3, {"scales": (1.0,)}, 8 + 9),
    ],
)
def test_parameters_are_counted_by_hand(
    features: int, outputs: int, changes: dict[str, object], count: int
) -> None:
    settings = replace(BASE, **changes)  # type: ignore[arg-type]
    model = make(settings, features, outputs)
    with torch.no_grad():
        model.log_scale += 0.1 * settings.trainable_scale  # scales of 1 are not counted
    assert model.policy("p", "e", {}).parameter_count == count


def test_the_same_generator_makes_the_same_model() -> None:
    first, again, other = (make(BASE, 4, seed=s).state_dict() for s in (1, 1, 2))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["theta"], other["theta"])
    assert set(first) == {"log_scale", "theta", "head.weights", "head.bias"}


def test_too_many_qubits_are_refused() -> None:
    assert make(replace(BASE, scales=(1.0,)), 12).theta.shape == (2 * 12 * 2,)
    with pytest.raises(TrainingError, match="there are 13 features"):
        make_model(BASE, 13, 2, torch.Generator())


def test_scales_for_another_number_of_features_are_refused() -> None:
    with pytest.raises(TrainingError, match="A copy has 2 scales for 3 features"):
        make(replace(BASE, scales=((1.0, 2.0),)), 3)
