"""Settings of the trainer, and the presets that fill them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from qcompile.errors import TrainingError
from qcompile.policy.layouts import LAYOUTS

_COUNTS = ("reuse", "environments", "horizon", "steps", "episodes", "epochs", "minibatch")


@dataclass(frozen=True)
class Settings:
    """Everything a training run depends on besides the environment and the seed."""

    # The model
    layout: str = "parallel"
    """How features become circuits: a name of `qcompile.policy.layouts.LAYOUTS`."""
    scales: tuple[float, ...] = (1.0,)
    """Input scale of each copy (or layer) of a feature; there are as many copies as scales."""
    trainable_scale: bool = False
    """Whether input scales are trained along."""
    reuse: int = 1
    """Copies of each output before the linear layer."""
    theta_spread_rad: float = 0.0
    """theta starts uniform in an interval of this width around 0."""
    weight_spread: float | None = None
    """Standard deviation of the first weights; None is Glorot's uniform law."""

    # The experience
    environments: int = 1
    """Environments that step together."""
    horizon: int | None = None
    """Steps of each environment between updates; None is one whole episode of one environment."""
    steps: int | None = None
    """Stop after this many environment steps."""
    episodes: int | None = None
    """Stop after this many episodes."""

    # The update
    actor_lr: float = 0.001
    """Adam's step size for the policy."""
    critic_lr: float = 0.01
    """Adam's step size for the value."""
    anneal: bool = False
    """Whether step sizes and entropy bonus fall linearly to the end of the run; step sizes stop
    falling at 2 % of their start."""
    gamma: float = 0.99
    """Discount."""
    gae_lambda: float = 1.0
    """Generalised advantage estimation; 1 is the discounted return less the value."""
    epochs: int = 4
    """Passes over each rollout."""
    minibatch: int | None = None
    """Steps in one gradient; None is the whole rollout."""
    clip: float = 0.1
    """PPO clips the probability ratio to 1 +- this."""
    entropy: float = 0.0
    """Weight of the entropy bonus."""
    gradient_norm: float | None = None
    """Gradients are cut to this norm."""
    scale_rewards: bool = False
    """Whether rewards are divided by the running standard deviation of returns."""
    bootstrap_truncated: bool = True
    """Whether the value stands in for what a time limit cut off; the paper takes 0."""
    pause_at: float | None = None
    """Algorithm 2: episodes with at least this reward update nothing; the longest such row saves
    the policy; updates resume when the running average falls below."""

    def __post_init__(self) -> None:
        if self.horizon is None and self.environments != 1:
            raise TrainingError(
                f"{self.environments} environments without a horizon.",
                "Whole episodes are collected from one environment.",
            )
        if self.layout not in LAYOUTS:
            raise TrainingError(f"Unknown layout {self.layout!r}.", f"Known: {', '.join(LAYOUTS)}.")
        if not self.scales or min(self.scales) <= 0:
            raise TrainingError(
                f"scales are {self.scales}.", "There is one at least, all positive."
            )
        for name in _COUNTS:
            value = getattr(self, name)
            if value is not None and value < 1:
                raise TrainingError(f"{name} is {value}.", "It is at least 1.")
        for name in ("gamma", "gae_lambda"):
            if not 0 <= getattr(self, name) <= 1:
                raise TrainingError(f"{name} is {getattr(self, name)}.", "It lies in [0, 1].")
        if self.steps is None and self.episodes is None:
            raise TrainingError("The training has no end.", "Set steps, episodes or both.")


_PAPER = Settings(bootstrap_truncated=False, episodes=1000)
_TUNED = Settings(
    scales=(1.0, 4.0),
    trainable_scale=True,
    theta_spread_rad=1.5,
    weight_spread=0.01,
    environments=16,
    horizon=128,
    steps=1_000_000,
    actor_lr=0.02,
    critic_lr=0.02,
    anneal=True,
    gae_lambda=0.98,
    epochs=6,
    minibatch=256,
    clip=0.2,
    entropy=0.01,
    gradient_norm=0.5,
    scale_rewards=True,
)

PRESETS: dict[str, dict[str, Settings]] = {
    "paper": {
        "": _PAPER,
        "CartPole": replace(_PAPER, reuse=16, episodes=500),
        "CartPole single": replace(_PAPER, actor_lr=0.004, critic_lr=0.04, episodes=500),
        "Acrobot": replace(
            _PAPER, reuse=8, actor_lr=0.004, critic_lr=0.04, gamma=0.98, episodes=300
        ),
        "LunarLander": replace(
            _PAPER,
            scales=(1.0, 1.0, 1.0),
            reuse=8,
            actor_lr=0.002,
            critic_lr=0.02,
            gamma=0.98,
            episodes=2000,
            pause_at=200.0,
        ),
    },
    "tuned": {
        "": _TUNED,
        "CartPole": replace(
            _TUNED, scales=(1.0,), environments=8, steps=300_000, gamma=0.999, entropy=0.0
        ),
        "Acrobot": replace(
            _TUNED, scales=(0.3, 1.0, 4.0), steps=2_000_000, gamma=0.995, entropy=0.003
        ),
        "LunarLander": replace(
            _TUNED,
            scales=(0.7, 2.0, 8.0),
            environments=32,
            horizon=256,
            steps=3_000_000,
            actor_lr=0.01,
            critic_lr=0.01,
            gamma=0.999,
            epochs=10,
            minibatch=1024,
        ),
    },
}
"""Settings by preset, then by environment (name without version); "" serves any other."""


def settings_for(preset: str, environment: str, layout: str = "parallel") -> Settings:
    """The settings of a preset for an environment and a layout.

    Raises:
        TrainingError: there is no such preset.
    """
    if preset not in PRESETS:
        raise TrainingError(f"Unknown preset {preset!r}.", f"Known: {', '.join(PRESETS)}.")
    family = environment.rsplit("-v", 1)[0]
    choices = PRESETS[preset]
    chosen = choices.get(f"{family} {layout}") or choices.get(family) or choices[""]
    return replace(chosen, layout=layout)
