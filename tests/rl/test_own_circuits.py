"""Own circuits in training: exported, sized, resumed, and refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from qiskit.circuit import ParameterVector, QuantumCircuit

from qcompile import Ansatz, Circuit, Encoder, Policy, Program
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.errors import QcompileError, TrainingError
from qcompile.policy.ansatz_file import ansatz_text
from qcompile.policy.files import policy_values
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.environments import training_environments
from qcompile.rl.models import CircuitModel, critic_size, make_critic, make_model, model_size
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator

OWN = Settings(layout="own", steps=64, horizon=32, theta_spread_rad=3.0)


def factored(features: int = 4) -> Ansatz:
    """Trained factors and shifts; the factor of the first qubit is shared, and an angle too."""
    x, s = ParameterVector("x", features), ParameterVector("s", features)
    t = ParameterVector("t", features)
    circuit = QuantumCircuit(features)
    for i in range(features):
        circuit.ry(s[i] * x[i] + t[i], i)
        circuit.rz(s[0] * x[i], i)
        circuit.rx(x[i] - s[0], i)
    return Ansatz.from_qiskit(circuit)


def policy() -> Policy:
    """A policy that has everything an encoder can have."""
    program = Program.of(
        [Circuit.parse("h ry(x0) rz(x1) ry(theta0)"), Circuit.parse("ry(x2) rz(theta1) ry(x0)")],
        3,
        2,
    )
    encoder = Encoder(
        ("tanh", "clip", "arctan"),
        np.array([3, 0, 1]),
        np.array([-2.0, 0.0, 1.5]),
        gain=np.array([1.5, 1.0, -0.5]),
        mean=np.array([0.1, 0.2, 0.3, 0.4]),
        std=np.array([1.0, 2.0, 3.0, 4.0]),
    )
    numbers = np.random.default_rng(0).normal(size=(2, 4))
    return Policy(
        "full", "CartPole-v1", encoder, program, np.array([0.3, -1.0]), numbers, np.ones(2), reuse=2
    )


SINGLE = Ansatz.of_program(Program.parse("inputs a b\nparameters w\n0: h ry(a) rz(b) ry(w)"))

VARIANTS: dict[str, tuple[Ansatz | None, dict[str, Any]]] = {
    "program": (SINGLE, {}),
    "scales for inputs": (SINGLE, {"scales": (0.5, 3.0), "trainable_scale": True, "reuse": 3}),
    "other features": (SINGLE, {"features": (3, 3), "encoder": ("tanh", "identity")}),
    "factors": (factored(), {"encoder": "tanh"}),
    "factors and gains": (factored(), {"trainable_gain": True, "trainable_scale": True}),
    "a policy": (Ansatz.of_policy(policy()), {"trainable_scale": True}),
    "a policy's gains": (Ansatz.of_policy(policy(), head=True), {"trainable_gain": True}),
    "a layout": (None, {"layout": "serial", "scales": (1.0, 2.0), "encoder": "clip"}),
    "a layout of two": (None, {"layout": "parallel", "features": (2, 3), "trainable_gain": True}),
}


def model(name: str, outputs: int = 2) -> CircuitModel:
    ansatz, changes = VARIANTS[name]
    made = make_model(replace(OWN, **changes), 4, outputs, torch.Generator().manual_seed(0), ansatz)
    assert isinstance(made, CircuitModel)
    return made


def logits(policy: Policy, observations: np.ndarray) -> np.ndarray:
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    return policy.logits(z)


def perturb(model: CircuitModel) -> None:
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter += 0.3 * torch.randn(parameter.shape, generator=generator)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("name", VARIANTS)
def test_the_exported_policy_computes_the_same(name: str, dtype: torch.dtype) -> None:
    own = model(name)
    perturb(own)
    observations = np.random.default_rng(2).normal(size=(20, 4))
    ours = own(torch.tensor(observations, dtype=dtype)).detach().numpy()
    found = logits(own.policy("p", "e", {}), observations)
    np.testing.assert_allclose(ours, found, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("name", VARIANTS)
def test_a_size_is_told_before_the_model_is_made(name: str) -> None:
    ansatz, changes = VARIANTS[name]
    for more in ({}, {"critic_hidden": (5, 6)}):
        settings, generator = replace(OWN, **changes, **more), torch.Generator()
        actor = make_model(settings, 4, 2, generator, ansatz)
        critic = make_critic(settings, 4, generator, ansatz)
        assert numbers(actor) == model_size(settings, 4, 2, ansatz)
        assert numbers(critic) == critic_size(settings, 4, ansatz)


def numbers(model: torch.nn.Module) -> int:
    return sum(tensor.numel() for tensor in model.state_dict().values())


def test_the_gradient_of_a_shared_factor_is_that_of_finite_differences() -> None:
    """Central differences in double precision of a factor that is an angle and a gain of others."""
    own = model("factors")
    perturb(own)
    observations = np.random.default_rng(3).normal(size=(6, 4))
    own(torch.tensor(observations)).square().sum().backward()
    theta, step, slopes = own.theta.detach().clone(), 1e-3, []
    for sign in (1, -1):
        with torch.no_grad():
            own.theta.copy_(theta)
            own.theta[0] += sign * step
        slopes.append((logits(own.policy("p", "e", {}), observations) ** 2).sum() / (2 * step))
    assert own.theta.grad is not None
    assert own.theta.grad[0].item() == pytest.approx(slopes[0] - slopes[1], rel=1e-3)


def test_factors_become_gains_and_leave_theta() -> None:
    """s1, s2 and s3 only multiply; s0 is an angle too."""
    own = model("factors")
    trained = own.policy("p", "e", {})
    assert len(own.theta) == 8
    assert len(trained.theta) == len(trained.program.parameters) == 5
    assert trained.encoder.gain is not None
    np.testing.assert_array_equal(trained.encoder.gain, 1.0)  # factors start at 1
    assert not set(trained.encoder.functions) - {"tanh"}


def test_scales_multiply_those_of_a_policy() -> None:
    ansatz = Ansatz.of_policy(policy())
    settings = replace(OWN, scales=(1.0, 2.0, 10.0))
    own = make_model(settings, 4, 2, torch.Generator(), ansatz)
    assert isinstance(own, CircuitModel)
    scale = own.policy("p", "e", {}).encoder.scale
    np.testing.assert_allclose(scale, [-2.0, 0.0, 15.0], rtol=1e-6)


@pytest.mark.parametrize("reuse", [1, 3])
def test_a_policy_starts_as_it_was(reuse: int) -> None:
    own = make_model(
        replace(OWN, reuse=reuse), 4, 2, torch.Generator(), Ansatz.of_policy(policy(), head=True)
    )
    assert isinstance(own, CircuitModel)
    observations = np.random.default_rng(4).normal(size=(50, 4))
    found = logits(own.policy("p", "e", {}), observations)
    np.testing.assert_allclose(found, logits(policy(), observations), rtol=1e-6, atol=1e-6)


def test_the_critic_starts_from_numbers_of_its_own() -> None:
    ansatz = Ansatz.of_policy(policy(), head=True)
    critic = make_critic(OWN, 4, torch.Generator().manual_seed(0), ansatz)
    assert isinstance(critic, CircuitModel)
    assert not np.isin(critic.theta.detach().numpy(), np.float32(policy().theta)).any()
    assert critic.program == ansatz.program


@pytest.mark.parametrize(
    ("inputs", "features", "read"),
    [(2, 4, [0, 1]), (4, 4, [0, 1, 2, 3]), (6, 3, [0, 1, 2, 0, 1, 2]), (5, 4, None)],
)
def test_inputs_read_the_features_in_turn(inputs: int, features: int, read: Any) -> None:
    circuits = [Circuit.parse(f"ry(x{i})") for i in range(inputs)]
    ansatz = Ansatz.of_program(Program.of(circuits, inputs))
    if read is None:
        with pytest.raises(TrainingError, match=r"5 inputs; observations have 4 (.|\n)*features="):
            make_model(OWN, features, 2, torch.Generator(), ansatz)
        return
    own = make_model(OWN, features, 2, torch.Generator(), ansatz)
    assert isinstance(own, CircuitModel)
    assert own.policy("p", "e", {}).encoder.feature.tolist() == read


@pytest.mark.parametrize(
    ("ansatz", "changes", "words"),
    [
        (SINGLE, {"features": (0,)}, "features has 1 numbers for 2 inputs"),
        (SINGLE, {"features": (0, 4)}, "features names feature 4.\n  Observations have features 0"),
        (SINGLE, {"encoder": ("tanh",) * 3}, "encoder has 3 functions for 2 inputs"),
        (SINGLE, {"scales": (1.0, 2.0, 3.0)}, "Own circuits need one number for all inputs"),
        (SINGLE, {"scales": ((1.0, 2.0),)}, "Own circuits need one number for all inputs"),
        (SINGLE, {"layout": "parallel"}, "Layout 'parallel' with own circuits"),
        (None, {}, "Layout 'own' without own circuits"),
        (SINGLE, {"model": "mvqc"}, "Model 'mvqc' cannot train a Program.\n  Train it as svqc."),
        (None, {"layout": "parallel", "encoder": ("tanh",)}, "encoder has 1 functions for 4"),
        (None, {"layout": "parallel", "features": (7,)}, "features names feature 7"),
    ],
)
def test_what_does_not_fit_is_refused(ansatz: Any, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(TrainingError) as caught:
        make_model(replace(OWN, **changes), 4, 2, torch.Generator(), ansatz)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("features", "actions", "words"),
    [
        (3, 2, "The circuits of policy full read feature 3; observations have 3 features"),
        (4, 3, "policy full has 2 actions; the environment has 3"),
    ],
)
def test_a_policy_that_does_not_fit_is_refused(features: int, actions: int, words: str) -> None:
    with pytest.raises(QcompileError) as caught:
        make_model(OWN, features, actions, torch.Generator(), Ansatz.of_policy(policy(), head=True))
    assert words in str(caught.value)


RUNS = {
    "factors": (factored(), {"trainable_gain": True}),
    "a policy": (Ansatz.of_policy(policy(), head=True), {"trainable_scale": True, "reuse": 2}),
    "under noise": (factored(), {"backend": "fake_lima", "shots": 64, "mitigation": "readout"}),
}


@pytest.mark.parametrize("name", RUNS)
def test_a_training_resumes_from_its_checkpoint_alone(name: str, tmp_path: Path) -> None:
    ansatz, changes = RUNS[name]
    settings = replace(OWN, actor_lr=0.05, steps=160, **changes)
    whole, half = (Trainer("CartPole-v1", settings, 3, ansatz=ansatz) for _ in range(2))
    whole.train()
    path, saves = tmp_path / "state", []

    def save_once() -> None:
        if half.steps == 64:
            save_checkpoint(half, path)
            saves.append(half.steps)

    half.train(on_update=save_once)
    resumed, differ = load_checkpoint(path)
    assert (saves, differ, resumed.steps) == ([64], [], 64)
    resumed.train()
    first, again = whole.policy(), resumed.policy()
    assert first is not None
    assert again is not None
    assert policy_values(first) == policy_values(again)
    assert first.metadata["circuits"]["origin"] == ansatz.origin


def test_the_policy_says_where_its_circuits_are_from() -> None:
    trained = Trainer("CartPole-v1", OWN, 0, ansatz=factored()).policy()
    assert trained is not None
    circuits = trained.metadata["circuits"]
    assert circuits["origin"] == "a Qiskit circuit"
    assert [*circuits["parameters"]] == [f"{n}[{i}]" for n in "st" for i in range(4)]
    of_policy = Trainer("CartPole-v1", OWN, 0, ansatz=Ansatz.of_policy(policy())).policy()
    assert of_policy is not None
    assert of_policy.metadata["circuits"] == {"origin": "policy full"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: None, "It has no circuits, but its settings have layout 'own'."),
        (lambda text: "{", "not JSON"),
        (lambda text: text.replace("ansatz-1", "ansatz-2"), "format"),
        (lambda text: ansatz_text(SINGLE), "numbers; its settings need"),
        (lambda text: text.replace('"ry"', '"cx"'), "Gate 'cx' takes no angle"),
    ],
)
def test_a_checkpoint_with_other_circuits_is_refused(
    change: Any, words: str, tmp_path: Path
) -> None:
    trainer = Trainer("CartPole-v1", OWN, 0, ansatz=factored())
    save_checkpoint(trainer, path := tmp_path / "state")
    saved = torch.load(path, weights_only=True)
    saved["ansatz"] = change(saved["ansatz"])
    torch.save(saved, path)
    with pytest.raises(QcompileError) as caught:
        load_checkpoint(path)
    assert str(caught.value).startswith(f"Checkpoint {path} is damaged.")
    assert words in str(caught.value)


def test_bits_of_a_number_are_read() -> None:
    """Feature b of an observation is bit b, and x = pi * gain * bit, as where it is played."""
    (environment,) = training_environments("FrozenLake-v1", 1, True, {"is_slippery": False})
    observation, _ = environment.reset(seed=0)
    assert observation.tolist() == [0, 0, 0, 0]
    for action, state in ((2, 1), (2, 2), (1, 6)):
        observation, *_ = environment.step(action)
        assert observation.tolist() == [float(bit) for bit in reversed(f"{state:04b}")]
    settings = replace(OWN, layout="parallel", encoder="bits", scales=(0.5,), trainable_scale=True)
    own = make_model(settings, 4, 2, torch.Generator())
    assert isinstance(own, CircuitModel)
    perturb(own)
    trained = own.policy("p", "e", {})
    assert trained.encoder.reads_bits
    states = np.arange(16)
    bits = (states[:, None] >> np.arange(4)) & 1
    ours = own(torch.tensor(bits, dtype=torch.float32)).detach().numpy()
    found = logits(trained, states[:, None].astype(float))
    np.testing.assert_allclose(ours, found, rtol=2e-5, atol=2e-5)


def test_bits_are_trained_and_resumed(tmp_path: Path) -> None:
    settings = replace(OWN, layout="parallel", encoder="bits", reuse=4)
    trainer = Trainer("FrozenLake-v1", settings, 0)
    assert trainer.train().policy is not None
    save_checkpoint(trainer, path := tmp_path / "state")
    resumed, _ = load_checkpoint(path)
    assert resumed.steps == trainer.steps
    with pytest.raises(TrainingError, match="CartPole-v1 observes a vector of 4"):
        Trainer("CartPole-v1", settings, 0)
    with pytest.raises(
        TrainingError, match=r"bits cannot be combined with others: .*\n.*: use bits alone"
    ):
        replace(settings, encoder=("bits", "tanh")).check()


def test_a_policy_of_bits_is_trained_on(tmp_path: Path) -> None:
    settings = replace(OWN, layout="parallel", encoder="bits")
    first = Trainer("FrozenLake-v1", settings, 0).policy()
    assert first is not None
    again = Trainer("FrozenLake-v1", OWN, 0, ansatz=Ansatz.of_policy(first, head=True)).policy()
    assert again is not None
    assert again.encoder.reads_bits
    states = np.arange(16.0)[:, None]
    np.testing.assert_allclose(logits(again, states), logits(first, states), atol=1e-6)


class State(gymnasium.Env[Any, Any]):
    """Stays in the first of its states for three steps."""

    action_space = spaces.Discrete(2)

    def __init__(self, states: int = 1, features: int = 0, actions: int = 2):
        self.observation_space = spaces.Discrete(states, start=5)
        if features:
            self.observation_space = spaces.Box(0, 1, (features,))
        self.action_space = spaces.Discrete(actions)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.count = 0
        return 5, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.count += 1
        return 5, 1.0, self.count == 3, False, {}


@pytest.fixture
def state() -> Iterator[str]:
    gymnasium.register("State-v0", State, disable_env_checker=True)
    yield "State-v0"
    gymnasium.registry.pop("State-v0")


def test_a_policy_of_the_one_bit_of_one_state_plays(state: str) -> None:
    policy = Trainer(state, Settings(encoder="bits", episodes=2), 0).train().policy
    assert isinstance(policy, Policy)
    assert play(Deployment(policy, "ideal"), 2).rewards.tolist() == [3.0, 3.0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"actions": 10**9},
            "State-v0 has 1,000,000,000 actions; training supports at most 100,000",
        ),
        (
            {"features": 2 * 10**6},
            "State-v0 has 2,000,000 features; training supports at most 100,000",
        ),
    ],
)
def test_what_no_memory_holds_is_refused(state: str, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(TrainingError, match=words):
        Trainer(state, Settings(episodes=1), 0, arguments=arguments)
