"""`train --init` of a network: it starts from the numbers of the network, and learns on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import qcompile
from qcompile.errors import QcompileError
from qcompile.policy import Convolution, Dense, Network
from qcompile.rl.models import NetworkModel
from qcompile.verbs.train_settings import TrainingRequest

OBSERVATIONS = np.linspace(-1, 1, 20).reshape(5, 4)


def network(*, convolution: bool = False) -> Network:
    rng = np.random.default_rng(1)
    first = (
        Convolution(rng.normal(size=(3, 1, 3)), rng.normal(size=3), "relu")
        if convolution
        else Dense(rng.normal(size=(12, 4)), rng.normal(size=12), "tanh")
    )
    last = Dense(rng.normal(size=(2, 12)), rng.normal(size=2))
    return Network("mine", "CartPole-v1", [first, last])


@pytest.mark.parametrize("convolution", [False, True])
def test_a_training_starts_from_its_logits(convolution: bool) -> None:
    import torch

    start = network(convolution=convolution)
    trainer = TrainingRequest(environment="CartPole-v1", init=start).trainer()
    assert isinstance(trainer.actor, NetworkModel)
    assert trainer.settings.model == ("cnn" if convolution else "fcn")
    with torch.no_grad():
        logits = trainer.actor(torch.from_numpy(OBSERVATIONS)).numpy()
    np.testing.assert_allclose(logits, start.logits(OBSERVATIONS), rtol=1e-5, atol=1e-5)


def test_a_file_is_learned_further(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    qcompile.save_policy(network(), file)
    training = qcompile.train("CartPole-v1", init=file, episodes=2, progress=False)
    assert isinstance(training.policy, Network)
    assert [len(layer.bias) for layer in training.policy.layers] == [12, 2]


@pytest.mark.parametrize(
    ("init", "options", "words"),
    [
        (network(), {"model": "svqc"}, "init and model 'svqc' cannot be combined"),
        (network(), {"layout": "serial"}, "init and layout cannot be combined"),
        (replace(network(), std=np.ones(4)), {}, "mine has its own normalisation of"),
        (network(), {"settings": {"hidden": [3]}}, "The layers of mine are dense, 4 to 12"),
    ],
)
def test_what_does_not_fit_is_refused(
    init: Network, options: dict[str, object], words: str
) -> None:
    with pytest.raises(QcompileError, match=words):
        qcompile.train("CartPole-v1", init=init, progress=False, **options)  # type: ignore[arg-type]
