"""Everything a training run depends on besides its environment and its seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Annotated, Any, Literal, get_args, get_type_hints

from pydantic import ConfigDict, Discriminator, Field, Tag, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from qcompile.catalogue import nearest
from qcompile.errors import TrainingError
from qcompile.policy.decision import MOST_HELD
from qcompile.policy.encoder import BITS
from qcompile.validation import explain

Model = Literal["svqc", "mvqc", "fcn", "cnn", "surrogate"]
PACKAGES = ("torch", "numpy", "gymnasium")
"""A training repeats with the same versions of these."""

Count = Annotated[int, Field(ge=1, le=1_000_000_000)]
Size = Annotated[int, Field(ge=1, le=10_000)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Magnitude = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Feature = Annotated[int, Field(ge=0, le=1_000_000)]
Scale = Magnitude | Annotated[tuple[Magnitude, ...], Field(min_length=1)]

Encoding = Literal["arctan", "tanh", "identity", "clip", "bits"]
Encodings = Annotated[
    Annotated[Encoding, Tag("<one>")] | Annotated[tuple[Encoding, ...], Tag("<each>")],
    Discriminator(lambda value: "<one>" if isinstance(value, str) else "<each>"),
]

_ENCODED = ("svqc", "mvqc", "surrogate")
_OF_MODELS: dict[str, tuple[str, ...]] = {
    "layout": ("svqc",),
    "features": ("svqc",),
    "encoder": ("svqc",),
    "trainable_gain": ("svqc",),
    "temperature": ("svqc", "surrogate"),
    "reuse": ("svqc", "mvqc", "surrogate"),
    "scales": _ENCODED,
    "trainable_scale": _ENCODED,
    "theta_spread_rad": ("svqc", "mvqc"),
    "backend": ("svqc",),
    "shots": ("svqc",),
    "mitigation": ("svqc",),
    "hidden": ("fcn", "cnn"),
    "activation": ("fcn", "cnn"),
}
"""Settings that only some models have."""


@dataclass(frozen=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class Settings:
    """Settings of one training; qcompile.rl.presets fills them.

    Raises:
        TrainingError: from `changed`, which checks values, and from `check`, which checks that
            they fit each other.
    """

    # The model
    model: Model = "svqc"
    """What is trained."""
    layout: Literal["parallel", "serial", "single", "own"] = "parallel"
    """How features become circuits: a name of `qcompile.policy.layouts.LAYOUTS`, or "own" for
    circuits that are given."""
    scales: Annotated[tuple[Scale, ...], Field(min_length=1)] = (1.0,)
    """Input scale of each copy (or layer) of the features, a number or one for each feature; there
    are as many copies as scales. Of own circuits: one for all inputs or one for each, times the
    scales that a policy's encoder has."""
    trainable_scale: bool = False
    """Whether input scales are trained along."""
    features: tuple[Feature, ...] | None = None
    """The features that are read: of a layout those it is made for, of own circuits that of each
    input. None is all of them, in order, or what the policy reads that the circuits are of."""
    encoder: Encodings | None = None
    """The function between a scaled feature and an angle: one for all, or one for each feature of a
    copy, for each input of own circuits. None is arctan, or what the policy has. bits reads the
    bits of a Discrete observation, and then its features are bits."""
    trainable_gain: bool = False
    """Whether a gain of each input, which multiplies what the encoder's function gives, is trained
    along. Factors of inputs that are parameters of own circuits always are."""
    reuse: Size = 1
    """Copies of each output before the linear layer."""
    theta_spread_rad: NotNegative = 0.0
    """theta starts uniform in an interval of this width around 0."""
    hidden: tuple[Size, ...] = (64, 64)
    """Sizes of the hidden layers of an fcn, channels of those of a cnn."""
    activation: Literal["relu", "tanh"] = "relu"
    """Between the layers of an fcn or a cnn."""
    weight_spread: Magnitude | None = None
    """Standard deviation of the first weights of the last layer; None is the model's usual law."""
    critic_hidden: tuple[Size, ...] | None = None
    """Sizes of the hidden layers of a fully connected critic, tanh between them; None is a critic
    of the policy's own kind, as in the paper. The critic is not deployed; a network's last layer
    starts near 0."""

    # What circuits are played on
    backend: str = "ideal"
    """Device whose noise the policy acts under while it learns."""
    shots: Count | None = None
    """Shots of each circuit and decision; None is the expectation without shot noise."""
    mitigation: Literal["none", "readout"] = "none"
    """What is done about readout errors."""

    # The experience
    hold: Annotated[int, Field(ge=1, le=MOST_HELD)] = 1
    """Steps of the environment that a decision is held for, which earn the sum of their rewards.
    The policy keeps it."""
    normalise: bool = False
    """Whether the models see observations less their running mean and divided by their running
    standard deviation, which the policy keeps."""
    environments: Size = 1
    """Environments that step together."""
    horizon: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Decisions in each environment between updates; None is a whole episode of one environment."""
    steps: Count | None = None
    """Stop after this many environment steps."""
    episodes: Count | None = None
    """Stop after this many episodes."""

    # The update
    rollouts: Annotated[int, Field(ge=1, le=100)] = 1
    """An update learns from this many of the latest rollouts, the older ones as if the present
    policy had played them."""
    actor_lr: Magnitude = 0.001
    """Adam's step size for the policy."""
    critic_lr: Magnitude = 0.01
    """Adam's step size for the value."""
    anneal: bool = False
    """Whether step sizes and entropy bonus fall linearly to 0 within `anneal_steps` or
    `anneal_episodes`, whichever is sooner; step sizes stop falling at 2 % of their start."""
    anneal_steps: Count | None = None
    """Environment steps to fall within; where this and `anneal_episodes` are None, `steps` and
    `episodes` are taken. Other budgets leave them as they are: a shorter training is the start of
    the longer one."""
    anneal_episodes: Count | None = None
    """Episodes to fall within."""
    gamma: Fraction = 0.99
    """Discount of a step of the environment; that of a decision is gamma**hold."""
    gae_lambda: Fraction = 1.0
    """Generalised advantage estimation, by decision; 1 is the discounted return less the value."""
    decision_cost: NotNegative = 0.0
    """What is taken off the reward of each decision while learning; no score has it."""
    epochs: Size = 4
    """Passes over each rollout."""
    minibatch: Count | None = None
    """Decisions in one gradient; None is the whole rollout."""
    clip: Magnitude = 0.1
    """PPO clips the probability ratio to 1 +- this."""
    entropy: NotNegative = 0.0
    """Weight of the entropy bonus."""
    gradient_norm: Magnitude | None = None
    """Gradients are cut to this norm."""
    scale_rewards: bool = False
    """Whether rewards are divided by the running standard deviation of returns."""
    bootstrap_truncated: bool = True
    """Whether the value stands in for what a time limit cut off; the paper takes 0."""
    average_share: Fraction = 0.0
    """The trained model is an average over the updates, that of about this last share of them; 0 is
    the model after the last one, 1 the mean over all. What acts and learns is not averaged."""
    temperature: Magnitude = 1.0
    """The logits of the policy that is handed over are divided by this: below 1 likely actions are
    likelier in it. What acts and learns has 1."""
    pause_at: float | None = None
    """Algorithm 2: episodes with at least this reward update nothing; the longest such row saves
    the policy; updates resume when the running average falls below."""

    def check(self) -> Settings:
        """These settings, where they fit each other, with the budgets of what falls filled in."""
        if self.horizon is None and self.environments != 1:
            raise TrainingError(
                f"{self.environments} environments without a horizon.",
                "Whole episodes are collected from one environment; set horizon.",
            )
        if self.steps is None and self.episodes is None:
            raise TrainingError("The training has no end.", "Set steps, episodes or both.")
        if self.average_share and self.pause_at is not None:
            raise TrainingError(
                "Both average_share and pause_at say which model is kept.",
                "Set average_share=0 or pause_at=none.",
            )
        if self.rollouts > 1 and self.pause_at is not None and self.horizon is not None:
            raise TrainingError(
                "Rollouts with a horizon are learned from in one row, and pause_at leaves gaps.",
                "Set rollouts=1, pause_at=none or horizon=none.",
            )
        for name, models in _OF_MODELS.items():
            if self.model not in models and getattr(self, name) != _DEFAULTS[name]:
                raise TrainingError(
                    f"Model {self.model!r} has no {name!r}, found {getattr(self, name)!r}.",
                    f"It is a setting of {' and '.join(models)}.",
                )
        if self.encoder is not None and BITS in self.encoder and self.encoder != BITS:
            raise TrainingError(
                f"The encoder {BITS} beside others, found {self.encoder}.",
                "An observation that is read as bits is one number: name it alone.",
            )
        budgets = (self.anneal_steps, self.anneal_episodes)
        if not self.anneal and budgets != (None, None):
            return replace(self, anneal_steps=None, anneal_episodes=None)
        if self.anneal and budgets == (None, None):
            return replace(self, anneal_steps=self.steps, anneal_episodes=self.episodes)
        return self

    def changed(self, **values: Any) -> Settings:
        """A copy with these values, checked; `steps` and `episodes` leave the annealing alone."""
        unknown = sorted(set(values) - set(_DEFAULTS))
        if unknown:
            raise TrainingError(
                f"Unknown setting {unknown[0]!r}.", nearest(unknown[0], SETTING_NAMES)
            )
        before = plain(self)
        if before["anneal_steps"] is None and before["anneal_episodes"] is None:
            before |= {"anneal_steps": self.steps, "anneal_episodes": self.episodes}
        return restored(before | values)


_DEFAULTS: Mapping[str, Any] = {field.name: field.default for field in fields(Settings)}
_ADAPTER = TypeAdapter(Settings)
SETTING_NAMES = tuple(_DEFAULTS)
_OPTIONAL = {n for n, hint in get_type_hints(Settings).items() if type(None) in get_args(hint)}


def from_toml(values: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a TOML file, which has no null: "none" is None where a setting may be None."""
    return {n: None if v == "none" and n in _OPTIONAL else v for n, v in values.items()}


def plain(settings: Settings) -> dict[str, Any]:
    """The settings as plain values, which `restored` reads back."""
    values: dict[str, Any] = _ADAPTER.dump_python(settings, mode="json")
    return values


def restored(values: Mapping[str, Any]) -> Settings:
    """The settings that `plain` gave.

    Raises:
        TrainingError: they are not settings.
    """
    try:
        return _ADAPTER.validate_python(dict(values)).check()
    except ValidationError as error:
        raise TrainingError("Settings that do not hold:", *explain(error)) from error
