"""Training beside the peers, in one run on one machine and one thread: `make bench`."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import torch
from measure import Row, compared, in_turn, seconds, show

from qcompile.rl.models import CircuitModel
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings

FEATURES, SCALES, ACTIONS, BATCH = 8, (0.7, 2.0, 8.0), 4, 512
ENVIRONMENTS, HORIZON, ROLLOUTS = 8, 256, 2
STEPS = ENVIRONMENTS * HORIZON * ROLLOUTS
FCN = (16, 32, 64, 32)
SHARED = Settings(
    environments=ENVIRONMENTS,
    horizon=HORIZON,
    minibatch=64,
    epochs=10,
    actor_lr=0.001,
    critic_lr=0.001,
    gae_lambda=0.95,
    clip=0.2,
    gradient_norm=0.5,
    steps=STEPS,
)
"""stable-baselines3's own batch, epochs, clip and gradient norm."""
MODELS = {
    "SVQC": {"scales": SCALES, "trainable_scale": True},
    "FCN": {"model": "fcn", "hidden": FCN},
}


class ClosedForm(torch.nn.Module):
    """A hand-written model of h ry(x) rz(x) ry(theta) and a linear layer."""

    def __init__(self) -> None:
        super().__init__()
        self.feature = torch.arange(FEATURES).repeat(len(SCALES))
        self.log_scale = torch.nn.Parameter(torch.zeros(len(self.feature)))
        self.theta = torch.nn.Parameter(torch.rand(len(self.feature)))
        self.linear = torch.nn.Linear(len(self.feature), ACTIONS)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        x = torch.arctan(observations[:, self.feature] * self.log_scale.exp())
        y = -torch.sin(x) * torch.cos(self.theta) - torch.cos(x) ** 2 * torch.sin(self.theta)
        return self.linear(y)


def pennylane_layers() -> torch.nn.Module:
    """24 TorchLayers of one wire each, and a linear layer."""
    import pennylane as qml

    device = qml.device("default.qubit", wires=1)

    @qml.qnode(device, interface="torch")
    def circuit(inputs, theta):  # type: ignore[no-untyped-def]
        qml.Hadamard(0)
        qml.RY(inputs[:, 0], 0)
        qml.RZ(inputs[:, 0], 0)
        qml.RY(theta, 0)
        return qml.expval(qml.PauliZ(0))

    class Layers(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            count = FEATURES * len(SCALES)
            self.circuits = torch.nn.ModuleList(
                [qml.qnn.TorchLayer(circuit, {"theta": 1}) for _ in range(count)]
            )
            self.linear = torch.nn.Linear(count, ACTIONS)

        def forward(self, observations: torch.Tensor) -> torch.Tensor:
            x = torch.arctan(observations.repeat(1, len(SCALES)))
            y = [circuit(x[:, i : i + 1]) for i, circuit in enumerate(self.circuits)]
            return self.linear(torch.stack(y, dim=1).float())

    return Layers()


def gradient(model: torch.nn.Module, observations: torch.Tensor) -> Callable[[], None]:
    """One forward and backward pass."""

    def work() -> None:
        model.zero_grad()
        model(observations).sum().backward()

    return work


def gradients() -> list[Row]:
    """Forward and backward pass of 512 observations through 24 circuits and a linear layer."""
    generator = torch.Generator().manual_seed(0)
    observations = torch.randn(BATCH, FEATURES, generator=generator)
    settings = Settings(scales=SCALES, trainable_scale=True)
    ours = gradient(CircuitModel(FEATURES, ACTIONS, settings, generator), observations)
    by_hand = gradient(ClosedForm(), observations)
    layers = gradient(pennylane_layers(), observations)
    layers()

    def twenty() -> None:
        for _ in range(20):
            ours()

    what = "forward and backward, 512 observations x 24 circuits; "
    return [
        compared(
            what + "the closed form by hand in torch",
            in_turn(ours, by_hand, 500),
            "<= 1.5",
            slower=True,
        ),
        compared(
            what + "PennyLane, 24 TorchLayers", in_turn(twenty, layers, 15), ">= 100", work=20
        ),
    ]


def stable_baselines3(environment: str) -> float:
    """Seconds that stable-baselines3's PPO takes for STEPS steps."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    environments = make_vec_env(environment, n_envs=ENVIRONMENTS, seed=0)
    trainer = PPO(
        "MlpPolicy",
        environments,
        n_steps=HORIZON,
        batch_size=SHARED.minibatch,
        n_epochs=SHARED.epochs,
        learning_rate=SHARED.actor_lr,
        gamma=SHARED.gamma,
        gae_lambda=SHARED.gae_lambda,
        clip_range=SHARED.clip,
        max_grad_norm=SHARED.gradient_norm,
        policy_kwargs={"net_arch": list(FCN), "activation_fn": torch.nn.ReLU},
        device="cpu",
        seed=0,
    )
    took = seconds(lambda: trainer.learn(STEPS))
    environments.close()
    return took


def training(environment: str, model: str) -> Row:
    """Whole trainings: environments, acting, advantages and updates."""
    scales = {"scales": (1.0,)} if environment.startswith("CartPole") and model == "SVQC" else {}
    settings = SHARED.changed(**{**MODELS[model], **scales})

    def ours() -> float:
        trainer = Trainer(environment, settings, 0)
        return seconds(trainer.train)

    ours()
    pairs = [(ours(), stable_baselines3(environment)) for _ in range(7)]
    what = f"{STEPS:,} steps of PPO in {environment}, {model}; stable-baselines3, MLP {FCN}"
    return compared(what, pairs, ">= 2.5" if model == "SVQC" else "")


def rows() -> list[Row]:
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    return [
        *gradients(),
        *(
            training(environment, model)
            for environment in ("CartPole-v1", "LunarLander-v3")
            for model in MODELS
        ),
    ]


if __name__ == "__main__":
    show(rows, "Training beside the peers.")
