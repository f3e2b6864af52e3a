"""`train` with circuits of one's own: a Qiskit circuit to a policy that plays, and further."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit.circuit import ParameterVector, QuantumCircuit
from qiskit.quantum_info import SparsePauliOp, Statevector

import qcompile
from qcompile import Ansatz, Policy, Simulator
from qcompile.errors import OptionError, OutputError
from qcompile.policy import load_policy
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for

Call = Callable[..., Any]

SCALES = np.array([1.0, 2.0, 10.0, 3.0])


def uploading(layers: int = 2) -> QuantumCircuit:
    """A qubit for each feature of CartPole, uploaded again with a trained scale and shift."""
    x = ParameterVector("x", 4)
    scale, shift = ParameterVector("scale", 4 * layers), ParameterVector("shift", 4 * layers)
    circuit = QuantumCircuit(4)
    for k in range(4 * layers):
        circuit.ry(scale[k] * x[k % 4] + shift[k], k % 4)
        circuit.rz(x[k % 4], k % 4)
    return circuit


def qiskit_z(policy: Policy, observations: np.ndarray) -> np.ndarray:
    """`<Z>` (B, circuits) by Qiskit, of the circuit with the numbers in the policy's metadata."""
    circuit = uploading().assign_parameters(policy.metadata["circuits"]["parameters"])
    rows = []
    for values in np.arctan(observations * SCALES):
        bound = circuit.assign_parameters({f"x[{i}]": value for i, value in enumerate(values)})
        state = Statevector(bound)
        rows.append([state.expectation_value(SparsePauliOp("Z"), [q]).real for q in range(4)])
    return np.array(rows)


def z(policy: Policy, observations: np.ndarray) -> np.ndarray:
    x = policy.encode(observations)
    return np.asarray(Simulator(policy.program).expectation(x, policy.theta))


def test_a_qiskit_circuit_with_trained_scales_is_trained_and_plays() -> None:
    observations = np.random.default_rng(0).normal(size=(10, 4))
    settings = settings_for("tuned", "CartPole-v1").changed(layout="own", scales=SCALES.tolist())
    before = Trainer("CartPole-v1", settings, 0, ansatz=Ansatz.from_qiskit(uploading())).policy()
    assert before is not None
    np.testing.assert_allclose(z(before, observations), qiskit_z(before, observations), atol=1e-9)
    training = qcompile.train(
        "CartPole-v1",
        circuits=uploading(),
        settings={"scales": SCALES, "trainable_scale": False, "theta_spread_rad": 1.0},
        episodes=30,
        progress=False,
    )
    policy = training.policy
    assert policy is not None
    np.testing.assert_allclose(z(policy, observations), qiskit_z(policy, observations), atol=1e-9)
    moved = policy.metadata["circuits"]["parameters"]
    assert all(abs(moved[f"scale[{k}]"] - 1.0) > 1e-3 for k in range(8))
    # Shifts, scales and gains of 4 inputs and 8 products, and the head.
    assert training.to_dict()["parameters"] == policy.parameter_count == 8 + 2 * 12 + 10
    result = qcompile.run(policy, backend="fake_lima", shots=256, episodes=5)
    assert result.mean_reward > 40  # random pushes last about 22 steps


def test_a_policy_starts_where_it_was(tmp_path: Path) -> None:
    first = qcompile.train("CartPole-v1", episodes=3, progress=False, out=tmp_path / "first.pt")
    policy = first.policy
    assert policy is not None
    observations = np.random.default_rng(1).normal(size=(20, 4))
    settings = settings_for("tuned", "CartPole-v1").changed(layout="own", scales=(1.0,))
    start = Ansatz.of_policy(policy, head=True)
    again = Trainer("CartPole-v1", settings, 5, ansatz=start).policy()
    assert again is not None
    wanted = policy.logits(z(policy, observations))
    np.testing.assert_allclose(again.logits(z(again, observations)), wanted, rtol=1e-6, atol=1e-6)
    more = qcompile.train("CartPole-v1", init=tmp_path / "first.pt", episodes=2, progress=False)
    assert more.policy is not None
    assert more.policy.metadata["circuits"] == {"origin": "policy first"}
    assert np.abs(more.policy.weights - policy.weights).max() > 0


def test_a_policy_is_trained_further_in_its_world() -> None:
    """It keeps the arguments of its environment, but for those that are given anew."""
    given = {"sutton_barto_reward": True, "max_episode_steps": 30}
    first = qcompile.train("CartPole-v1", env=given, episodes=1, progress=False).policy
    assert first is not None
    again = qcompile.train(
        "CartPole-v1", init=first, env={"max_episode_steps": 20}, episodes=1, progress=False
    ).policy
    assert again is not None
    assert again.environment_kwargs == given | {"max_episode_steps": 20}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"circuits": "cartpole", "init": "cartpole"}, "circuits and init cannot be combined"),
        ({"circuits": "cartpole", "layout": "serial"}, "circuits and layout cannot be combined"),
        ({"init": "cartpole", "layout": "serial"}, "init and layout cannot be combined"),
        ({"init": "cartpole", "reuse": 2}, "init and reuse cannot be combined"),
        ({"init": "cartpole", "settings": {"reuse": 2}}, "init and reuse cannot be combined"),
        ({"circuits": "cartpole", "model": "mvqc"}, "circuits and model 'mvqc' cannot be combined"),
        ({"circuits": "cartpole", "resume": "state"}, "circuits cannot be combined with resume"),
        ({"init": "cartpole", "resume": "state"}, "init cannot be combined with resume"),
    ],
)
def test_what_cannot_be_given_together(options: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError) as caught:
        qcompile.train("CartPole-v1", episodes=1, progress=False, **options)
    assert words in str(caught.value)


PAGE = Path(__file__).parents[2] / "docs" / "howto" / "circuits.md"


def test_the_page_s_program_is_trained() -> None:
    blocks = PAGE.read_text().split("```\n")
    (program,) = (block for block in blocks if block.startswith("OPENQASM"))
    Path("pole.qasm").write_text(program)
    settings = {"features": [2, 3], "scales": [10, 3]}
    training = qcompile.train(
        "CartPole-v1", circuits="pole.qasm", settings=settings, episodes=1, progress=False
    )
    assert training.policy is not None
    assert training.policy.encoder.feature.tolist() == [2, 3]
    assert [*training.policy.metadata["circuits"]["parameters"]] == ["w", "b"]


def test_files_are_trained_at_the_command_line(qcompile: Call) -> None:
    Path("own.qasm").write_text(
        "OPENQASM 3.0;\ninput float[64] x0;\ninput float[64] x1;\ninput float[64] a;\n"
        "qubit[2] q;\nry(a*x0) q[0];\nrx(x1+a) q[1];\n"
    )
    words = ("--episodes", 1, "--out", "p.json", "--force")
    settings = ("-s", "features=2,3", "-s", "encoder=tanh,clip", "-s", "scales=10,3")
    assert qcompile("train", "CartPole-v1", "--circuits", "own.qasm", *settings, *words).code == 0
    policy = load_policy("p.json")
    assert policy.encoder.functions == ("tanh", "clip")
    assert policy.encoder.feature.tolist() == [2, 3]
    assert policy.metadata["circuits"]["origin"] == "OpenQASM own.qasm"
    assert policy.metadata["settings"]["layout"] == "own"
    assert qcompile("train", "CartPole-v1", "--circuits", "p.json", *words, "--force").code == 0
    again = load_policy("p.json")
    assert again.encoder.feature.tolist() == [2, 3]
    assert again.metadata["circuits"]["origin"] == "policy p"
    assert qcompile("train", "CartPole-v1", "--init", "p.json", *words, "--force").code == 0


def test_a_resumed_training_overwrites_its_policy_of_an_earlier_update(tmp_path: Path) -> None:
    """What `out` was written with are numbers of another update than the checkpoint's."""
    out, state = tmp_path / "p.json", tmp_path / "state"

    def once(scalars: Any, steps: int) -> bool:
        return "update/entropy" not in scalars

    settings = {"horizon": 8, "environments": 1, "rollouts": 1}
    first = {"circuits": uploading(), "settings": settings, "steps": 32, "checkpoint": state}
    qcompile.train("CartPole-v1", **first, out=out, callback=once, progress=False)
    qcompile.train("CartPole-v1", resume=state, callback=once, progress=False)
    qcompile.train("CartPole-v1", resume=state, out=out, progress=False)
    assert load_policy(out).metadata["steps"] == 32
    other = {**first, "circuits": uploading(1), "checkpoint": tmp_path / "other"}
    qcompile.train("CartPole-v1", **other, callback=once, progress=False)
    with pytest.raises(OutputError, match="already exists"):
        qcompile.train("CartPole-v1", resume=tmp_path / "other", out=out, progress=False)
