"""Training of own circuits of several qubits: they are what Qiskit makes of their policy's file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from wide import operator

import qcompile
from qcompile.errors import CircuitError, OptionError, PolicyError
from qcompile.ir import Circuit, Program
from qcompile.policy import Ansatz, Policy, load_policy
from qcompile.policy.ansatz_file import ansatz_text, load_ansatz, read_ansatz
from qcompile.policy.files import policy_values
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.models import CircuitModel, make_model, model_size
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings

Call = Callable[..., Any]

PAIR = Circuit.of(
    [
        *(["ry", "x0+pi/2", 0], ["ry", "0.5*x1", 1], ["ry", "theta0", 1]),
        *(["cz", 0, 1], ["rx", "theta1", 0], ["ecr", 1, 0], ["ry", "x0-theta2", 0]),
    ],
    2,
)
PROGRAM = Program(
    (PAIR, Circuit.parse("h ry(x2) rz(x2) ry(theta2)")),
    ("x0", "x1", "x2"),
    ("theta0", "theta1", "theta2"),
    observables=((0, 1), (2,), (1,)),
)
"""A circuit on two qubits beside one on one, measured in another order."""

OWN = Settings(
    model="mvqc", layout="own", theta_spread_rad=2.0, environments=2, horizon=16, steps=96
)


def by_qiskit(policy: Policy, observations: np.ndarray) -> np.ndarray:
    """`<O>` (B, 3) of the program above, from the unitaries of the policy's circuits."""
    found = []
    for row in policy.encode(observations):
        values = dict(zip(policy.program.inputs, row.tolist(), strict=True))
        values |= dict(zip(policy.program.parameters, policy.theta.tolist(), strict=True))
        pair, single = (
            np.abs(operator(circuit, values)[:, 0]) ** 2 for circuit in policy.program.circuits
        )
        found.append([pair @ [1, -1, -1, 1], single @ [1, -1], pair @ [1, 1, -1, -1]])
    return np.array(found)


def perturbed(model: torch.nn.Module) -> CircuitModel:
    """The model with every parameter changed, reproducibly."""
    assert isinstance(model, CircuitModel)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter += 0.3 * torch.randn(parameter.shape, generator=generator)
    return model


@pytest.mark.parametrize("changes", [{}, {"reuse": 3}, {"features": (3, 0, 2)}], ids=str)
def test_the_policy_of_own_circuits_computes_the_same(changes: dict[str, Any]) -> None:
    settings, ansatz = replace(OWN, **changes), Ansatz.of_program(PROGRAM)
    made = make_model(settings, 4, 2, torch.Generator().manual_seed(0), ansatz)
    assert sum(t.numel() for t in made.state_dict().values()) == model_size(settings, 4, 2, ansatz)
    model = perturbed(made)
    observations = np.random.default_rng(0).normal(size=(6, 4))
    ours = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    policy = model.policy("p", "e", {})
    assert policy.program.observables == PROGRAM.observables
    np.testing.assert_allclose(
        ours, policy.logits(by_qiskit(policy, observations)), rtol=2e-5, atol=2e-5
    )


RUNS: dict[str, dict[str, Any]] = {
    "exact": {"average_share": 0.5},
    "two rollouts": {"rollouts": 2},
    "under noise": {"backend": "fake_lima", "shots": 64, "mitigation": "readout"},
}


@pytest.mark.parametrize("name", RUNS)
def test_a_training_resumes_bit_for_bit(name: str, tmp_path: Path) -> None:
    settings = replace(OWN, actor_lr=0.05, **RUNS[name])
    ansatz = Ansatz.of_program(PROGRAM)
    whole, half = (Trainer("CartPole-v1", settings, 3, ansatz=ansatz) for _ in range(2))
    whole.train()
    path = tmp_path / "state"
    half.train(on_update=lambda: (save_checkpoint(half, path), False)[1])
    resumed, differ = load_checkpoint(path)
    assert (differ, resumed.steps) == ([], 32)
    resumed.train()
    assert policy_values(resumed.policy()) == policy_values(whole.policy())


def test_a_file_of_circuits_is_read_as_it_was_written(tmp_path: Path) -> None:
    ansatz = Ansatz.of_program(PROGRAM, "mine")
    ansatz.save(tmp_path / "mine.json")
    for again in (load_ansatz(tmp_path / "mine.json"), read_ansatz(ansatz_text(ansatz))):
        assert (again.program, again.origin) == (PROGRAM, "mine")
    assert str(ansatz).splitlines()[2:] == str(PROGRAM).splitlines()[2:]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"qubits": 2, "gates": [["cz", 0, 2]]}', "circuits.0.gates.0: Gate 'cz' acts on 2"),
        ('{"qubits": 2, "gates": [["ry", "y", 0]]}', "Unknown symbol 'y' in circuit 0"),
        ('{"qubits": 2, "gates": [["ry", "x0", 0]]}], "observables": [[2]', "has bit 2"),
    ],
)
def test_a_wrong_file_of_circuits_is_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(f'{{"format": "qcompile-ansatz-1", "circuits": [{text}]}}')
    with pytest.raises(PolicyError) as caught:
        load_ansatz(path)
    assert str(caught.value).startswith(f"{path} is not a file of circuits.")
    assert words in str(caught.value)


PAIR_POLICY = {
    "format": "qcompile-policy-2",
    "name": "pair",
    "environment": "CartPole-v1",
    "encoder": {"function": "arctan", "feature": [2, 3], "scale": [4, 1]},
    "circuits": [
        {
            "qubits": 2,
            "gates": [["ry", "x0+pi/2", 0], ["ry", "x1", 1], ["cz", 0, 1], ["ry", "theta0", 1]],
        }
    ],
    "observables": [[0], [0, 1]],
    "theta": [1.5708],
    "weights": [[4, 4], [-4, -4]],
    "bias": [0, 0],
}


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    import json

    path = tmp_path / "pair.json"
    path.write_text(json.dumps(PAIR_POLICY))
    return path


def test_the_circuits_of_a_policy_file_are_trained_and_played(
    pair: Path, tmp_path: Path, qcompile: Call
) -> None:
    out = tmp_path / "trained.json"
    words = ("--circuits", pair, "--episodes", 3, "--evaluate-every", 3, "--out", out, "--json")
    found = qcompile("train", "CartPole-v1", *words, "--evaluate-episodes", 2).json()
    assert found["model"] == "mvqc"
    # theta, 2 scales, and 2 outputs of 2 observables
    assert found["parameters"] == 1 + 2 + 2 * 3
    assert len(found["evaluations"]) == 1
    trained = load_policy(out)
    assert isinstance(trained, Policy)
    assert trained.program == load_ansatz(pair).program
    assert trained.metadata["circuits"] == {"origin": "policy pair"}
    played = qcompile("run", out, "--backend", "fake_lima", "--episodes", 1, "--json").json()
    assert played["kind"] == "noise-model"


def test_a_policy_starts_where_it_was(pair: Path) -> None:
    """The policy balances the pole for long from its first episode on."""
    more = qcompile.train("CartPole-v1", init=pair, hold=2, episodes=2, progress=False)
    assert min(more.rewards) > 60, "random pushes last about 22 steps"
    assert (more.policy.hold, more.to_dict()["model"]) == (2, "mvqc")


def test_several_seeds_find_the_best(pair: Path, tmp_path: Path) -> None:
    best = qcompile.train(
        "CartPole-v1",
        circuits=pair,
        seeds=2,
        evaluation=3,
        episodes=2,
        workers=1,
        out=tmp_path / "best.json",
        progress=False,
    )
    assert len(best.trainings) == 2
    assert load_policy(tmp_path / "best.json").metadata["seed"] == best.to_dict()["best"]["seed"]


@pytest.mark.parametrize("model", ["svqc", "surrogate"])
def test_another_model_is_refused(model: str, pair: Path) -> None:
    with pytest.raises(OptionError, match="circuits or layers have model mvqc"):
        qcompile.train("CartPole-v1", circuits=pair, model=model)


def test_too_many_qubits_are_refused() -> None:
    circuit = Circuit.of([["ry", "x0", 0], *(["cz", q, q + 1] for q in range(16))], 17)
    with pytest.raises(CircuitError, match="A circuit has 17 qubits"):
        make_model(OWN, 1, 2, torch.Generator(), Ansatz.of_program(Program.of([circuit], 1)))
