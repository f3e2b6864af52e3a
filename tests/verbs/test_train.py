"""`qcompile.train`: what it gives, what ends it early, and what it refuses."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

import qcompile
from qcompile.errors import OptionError, QcompileError


@pytest.fixture
def ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C is pressed when the third episode is counted."""
    counted = 0

    @contextmanager
    def bar(*_: object, **__: object) -> Iterator[Callable[[float, str], None]]:
        def show(done: float, words: str) -> None:
            nonlocal counted
            counted += 1
            if counted == 3:
                signal.raise_signal(signal.SIGINT)

        yield show

    monkeypatch.setattr("qcompile.report.progress.progress_bar", bar)


def test_a_training_gives_its_policy_and_writes_nothing() -> None:
    training = qcompile.train("CartPole-v1", preset="paper", episodes=4, seed=1)
    training.check_complete()
    assert training.policy is not None
    assert training.policy.environment == "CartPole-v1"
    # CartPole pays 1 a step: of one environment, rewards are the differences of the steps.
    steps = [episode["steps"] for episode in training.episodes]
    assert training.rewards == np.diff([0, *steps]).tolist()
    assert training.to_dict()["last_20_mean_reward"] == pytest.approx(np.mean(training.rewards))
    assert qcompile.run(training.policy, episodes=1, max_steps=3).rewards == [3.0]
    assert training.plot().png[:8] == b"\x89PNG\r\n\x1a\n"
    assert repr(training).splitlines()[1].split()[:3] == ["CartPole-v1", "svqc", "1"]
    assert list(Path().iterdir()) == []


def test_a_policy_is_named_after_the_file_it_is_saved_to(tmp_path: Path) -> None:
    policy = qcompile.train("CartPole-v1", preset="paper", episodes=1, progress=False).policy
    assert isinstance(policy, qcompile.Policy)
    assert policy.name == "trained-cartpole", "no shipped policy is called so"
    for name, kept in ((policy.name, "pole"), ("mine", "mine")):
        qcompile.save_policy(replace(policy, name=name), tmp_path / "pole.json")
        assert qcompile.load_policy(tmp_path / "pole.json").name == kept


@pytest.mark.parametrize("model", ["fcn", "cnn"])
def test_a_network_is_played_and_stands_beside_circuits(model: str) -> None:
    training = qcompile.train("CartPole-v1", model=model, preset="paper", episodes=2)
    network = training.policy
    assert isinstance(network, qcompile.Network)
    assert network.parameter_count == training.to_dict()["parameters"]
    assert network.metadata["settings"]["model"] == model
    observations = np.random.default_rng(0).normal(size=(9, 4)).astype(np.float32)
    logits = training.model(torch.from_numpy(observations)).detach().numpy()
    np.testing.assert_allclose(network.logits(observations), logits, atol=1e-5)
    result = qcompile.run(network, episodes=2, seed=7)
    grid = qcompile.evaluate(
        [network, "cartpole_1q"],
        "ideal",
        shots="exact",
        mitigations="none",
        episodes=2,
        seed=7,
        workers=1,
    )
    assert grid.cells[0]["episodes"] == result.episodes
    assert [cell["circuits_per_step"] > 0 for cell in grid.cells] == [False, True]
    assert grid.plot().png[:8] == b"\x89PNG\r\n\x1a\n"


def test_ctrl_c_keeps_what_is_trained(ctrl_c: None) -> None:
    training = qcompile.train("CartPole-v1", preset="paper")
    assert training.interrupted
    assert len(training.rewards) == 3
    assert training.policy is not None
    with pytest.raises(QcompileError) as error:
        training.check_complete()
    assert str(error.value) == "Interrupted."


def test_a_checkpoint_is_gone_on_with(ctrl_c: None) -> None:
    whole = qcompile.train("CartPole-v1", preset="paper", episodes=5, checkpoint="state")
    assert whole.interrupted
    training = qcompile.train("CartPole-v1", resume="state")
    assert (len(training.rewards), training.to_dict()["preset"]) == (5, None)
    told: list[str] = []
    again = qcompile.train("CartPole-v1", resume="state", on_note=told.append)
    assert again.rewards == training.rewards
    assert told == ["The training in state is finished; only its output files are written."]


def test_an_environment_by_its_specification() -> None:
    spec = gymnasium.spec("CartPole-v1")
    by_name = qcompile.train("CartPole-v1", preset="paper", episodes=2)
    assert qcompile.train(spec, preset="paper", episodes=2).rewards == by_name.rewards
    own = gymnasium.envs.registration.EnvSpec(
        "Mine-v0", entry_point=spec.entry_point, max_episode_steps=9
    )
    try:
        training = qcompile.train(own, preset="paper", episodes=2)
        assert training.policy is not None
        assert training.policy.environment == "Mine-v0"
        assert max(training.rewards) <= 9
        other = gymnasium.envs.registration.EnvSpec("Mine-v0", entry_point=spec.entry_point)
        with pytest.raises(OptionError, match="'Mine-v0' is already registered"):
            qcompile.train(other)
    finally:
        gymnasium.registry.pop("Mine-v0", None)
    with pytest.raises(OptionError, match=r"class or function that makes one, not CartPoleEnv"):
        qcompile.train(gymnasium.make("CartPole-v1").unwrapped)  # type: ignore[arg-type]


def test_noise_brings_shots_and_mitigation() -> None:
    def learned_under(**options: Any) -> tuple[Any, ...]:
        values = qcompile.train("CartPole-v1", preset="paper", episodes=1, **options).to_dict()
        return values["backend"], values["shots"], values["mitigation"]

    assert learned_under() == ("ideal", "exact", "none")
    assert learned_under(backend="ibm_lima") == ("ibm_lima", 1024, "readout")
    assert learned_under(backend="ibm_lima", shots="exact") == ("ibm_lima", "exact", "readout")
    assert learned_under(shots=9, settings={"mitigation": "readout"}) == ("ideal", 9, "readout")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"evaluate_episodes": 3}, "evaluate_episodes needs evaluate_every"),
        ({"settings": {"clp": 1}}, "Unknown setting 'clp'.\n  Did you mean clip?"),
        ({"settings": {"model": "fcn"}}, "'model' cannot be changed as a setting"),
        ({"settings": {"reuse": 2}, "reuse": 2}, "reuse is given twice, as an option"),
        ({"resume": "state", "preset": "tuned"}, "preset cannot be combined with resume"),
        ({"out": "p.txt"}, "p.txt must end with .pt or .json."),
        ({"out": "p.pt", "log": "x/../p.pt"}, "out and log are the same file, x/../p.pt."),
    ],
)
def test_contradictions_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError) as error:
        qcompile.train("CartPole-v1", **options)
    assert str(error.value).startswith(words)
    assert list(Path().iterdir()) == []
