"""Everything a training depends on besides its environment and seed."""

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
"""A training is repeatable with the same versions of these packages."""

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

_CIRCUITS = ("svqc", "mvqc")
_ENCODED = (*_CIRCUITS, "surrogate")
_OF_MODELS: dict[str, tuple[str, ...]] = {
    "layout": ("svqc",),
    "features": _CIRCUITS,
    "encoder": _CIRCUITS,
    "trainable_gain": _CIRCUITS,
    "temperature": _ENCODED,
    "reuse": _ENCODED,
    "scales": _ENCODED,
    "trainable_scale": _ENCODED,
    "theta_spread_rad": _CIRCUITS,
    "backend": _CIRCUITS,
    "shots": _CIRCUITS,
    "mitigation": _CIRCUITS,
    "hidden": ("fcn", "cnn"),
    "activation": ("fcn", "cnn"),
}
"""The models of settings that only some models have."""


@dataclass(frozen=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class Settings:
    """The settings of one training; qcompile.rl.presets provides them.

    Raises:
        TrainingError: from `changed`, which checks values, and from `check`, which checks that
            they fit each other.
    """

    # The model
    model: Model = "svqc"
    """The model that is trained."""
    layout: Literal["parallel", "serial", "single", "own"] = "parallel"
    """How features become circuits: a name in `qcompile.policy.layouts.LAYOUTS`, or "own" for given
    circuits. An mvqc without own circuits has "parallel"."""
    scales: Annotated[tuple[Scale, ...], Field(min_length=1)] = (1.0,)
    """Input scale of each copy (or layer) of the features, a number or one per feature; their
    number is the number of copies. For own circuits: one for all inputs or one per input,
    multiplied by the scales of a policy's encoder."""
    trainable_scale: bool = False
    """Whether input scales are trained too."""
    features: tuple[Feature, ...] | None = None
    """The features that are read: for a layout its features, for own circuits the feature of each
    input. None means all, in order, or the features of the policy that the circuits come from."""
    encoder: Encodings | None = None
    """The function from a scaled feature to an angle: one for all, or one per feature of a copy, or
    per input of own circuits. None means arctan, or the policy's function. bits reads the bits of a
    Discrete observation as features."""
    trainable_gain: bool = False
    """Whether a gain of each input, which multiplies the result of the encoder's function, is
    trained too. Factors of inputs that are parameters of own circuits always are."""
    reuse: Size = 1
    """Copies of each output before the linear layer."""
    theta_spread_rad: NotNegative = 0.0
    """theta starts uniform in an interval of this width around 0."""
    hidden: tuple[Size, ...] = (64, 64)
    """Sizes of the hidden layers of an fcn, or channels of those of a cnn."""
    activation: Literal["relu", "tanh"] = "relu"
    """The activation between the layers of an fcn or a cnn."""
    weight_spread: Magnitude | None = None
    """Standard deviation of the initial weights of the last layer; None is the model's default."""
    critic_hidden: tuple[Size, ...] | None = None
    """Sizes of the hidden layers of a fully connected critic, with tanh between them; None is a
    critic of the policy's kind, as in the paper. The critic is not deployed; the last layer of a
    network starts near 0."""

    # The backend of circuits
    backend: str = "ideal"
    """Device whose noise the policy acts under during training."""
    shots: Count | None = None
    """Shots of each circuit and decision; None is the expectation without shot noise."""
    mitigation: Literal["none", "readout"] = "none"
    """The mitigation of readout errors."""

    # The experience
    hold: Annotated[int, Field(ge=1, le=MOST_HELD)] = 1
    """Environment steps that a decision is held for; its reward is the sum of theirs. The policy
    keeps this value."""
    normalise: bool = False
    """Whether observations are normalised by their running mean and standard deviation, which the
    policy keeps."""
    environments: Size = 1
    """Environments that step together."""
    horizon: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Decisions in each environment between updates; None is one whole episode of one
    environment."""
    steps: Count | None = None
    """Stop after this many environment steps."""
    episodes: Count | None = None
    """Stop after this many episodes."""

    # The update
    rollouts: Annotated[int, Field(ge=1, le=100)] = 1
    """The number of latest rollouts that an update learns from, the older ones as if the current
    policy had played them."""
    actor_lr: Magnitude = 0.001
    """Adam's step size for the policy."""
    critic_lr: Magnitude = 0.01
    """Adam's step size for the value."""
    anneal: bool = False
    """Whether step sizes and entropy bonus fall linearly to 0 within `anneal_steps` or
    `anneal_episodes`, whichever comes first; step sizes stop at 2 % of their initial value."""
    anneal_steps: Count | None = None
    """Environment steps of the annealing; if this and `anneal_episodes` are None, `steps` and
    `episodes` are used. Changing the budget later does not change them: a shorter training is then
    the start of the longer one."""
    anneal_episodes: Count | None = None
    """Episodes of the annealing."""
    gamma: Fraction = 0.99
    """Discount of an environment step; the discount of a decision is gamma**hold."""
    gae_lambda: Fraction = 1.0
    """Lambda of generalised advantage estimation; 1 is the discounted return minus the value."""
    decision_cost: NotNegative = 0.0
    """Subtracted from the reward of each decision in training; scores do not include it."""
    epochs: Size = 4
    """Passes over each rollout."""
    minibatch: Count | None = None
    """Decisions per gradient step; None is the whole rollout."""
    clip: Magnitude = 0.1
    """PPO clips the probability ratio to 1 +- this."""
    entropy: NotNegative = 0.0
    """Weight of the entropy bonus."""
    gradient_norm: Magnitude | None = None
    """Gradients are clipped to this norm."""
    scale_rewards: bool = False
    """Whether rewards are divided by the running standard deviation of returns."""
    bootstrap_truncated: bool = True
    """Whether the value replaces the rewards that a time limit cut off; the paper uses 0."""
    average_share: Fraction = 0.0
    """The trained model is an average over about this last fraction of the updates; 0 is the model
    after the last update, 1 the mean over all. The model that acts and learns is not averaged."""
    temperature: Magnitude = 1.0
    """The logits of the final policy are divided by this: below 1, likely actions become likelier.
    The model that acts and learns uses 1."""
    pause_at: float | None = None
    """Algorithm 2: no update follows an episode with at least this reward; the policy at the end of
    the longest such streak is kept; updates resume when the running average falls below it."""

    def check(self) -> Settings:
        """These settings, checked to fit each other, with the annealing budgets filled in."""
        if self.horizon is None and self.environments != 1:
            raise TrainingError(
                f"{self.environments} environments need a horizon.",
                "Whole episodes can be collected only from one environment; set horizon.",
            )
        if self.steps is None and self.episodes is None:
            raise TrainingError("The training has no end.", "Set steps, episodes or both.")
        if self.average_share and self.pause_at is not None:
            raise TrainingError(
                "average_share and pause_at cannot be combined: both decide which model is kept.",
                "Set average_share=0 or pause_at=none.",
            )
        if self.rollouts > 1 and self.pause_at is not None and self.horizon is not None:
            raise TrainingError(
                "pause_at leaves gaps, but several rollouts with a horizon must be consecutive.",
                "Set rollouts=1, pause_at=none or horizon=none.",
            )
        for name, models in _OF_MODELS.items():
            if (self.model, name, self.layout) == ("mvqc", "layout", "own"):
                continue
            if self.model not in models and getattr(self, name) != _DEFAULTS[name]:
                value = getattr(self, name)
                raise TrainingError(
                    f"Model {self.model!r} has no setting {name!r} (found {value!r}).",
                    f"It belongs to {' and '.join(models)}.",
                )
        if self.encoder is not None and BITS in self.encoder and self.encoder != BITS:
            raise TrainingError(
                f"The encoder {BITS} cannot be combined with others: {self.encoder}.",
                f"An observation that is read as bits is one number: use {BITS} alone.",
            )
        budgets = (self.anneal_steps, self.anneal_episodes)
        if not self.anneal and budgets != (None, None):
            return replace(self, anneal_steps=None, anneal_episodes=None)
        if self.anneal and budgets == (None, None):
            return replace(self, anneal_steps=self.steps, anneal_episodes=self.episodes)
        return self

    def changed(self, **values: Any) -> Settings:
        """A checked copy with these values; `steps` and `episodes` do not change the annealing."""
        unknown = sorted(set(values) - set(_DEFAULTS))
        if unknown:
            raise TrainingError(f"Unknown setting {unknown[0]!r}.", nearest_setting(unknown[0]))
        before = plain(self)
        if before["anneal_steps"] is None and before["anneal_episodes"] is None:
            before |= {"anneal_steps": self.steps, "anneal_episodes": self.episodes}
        return restored(before | values)


_DEFAULTS: Mapping[str, Any] = {field.name: field.default for field in fields(Settings)}
_ADAPTER = TypeAdapter(Settings)
SETTING_NAMES = tuple(_DEFAULTS)
_OPTIONAL = {n for n, hint in get_type_hints(Settings).items() if type(None) in get_args(hint)}


def nearest_setting(name: str) -> str:
    """A hint: the settings closest to `name`, or all of them."""
    return nearest(name, SETTING_NAMES, most=len(SETTING_NAMES))


def from_toml(values: Mapping[str, Any]) -> dict[str, Any]:
    """Settings from a TOML file, which has no null: "none" means None if a setting allows it."""
    return {n: None if v == "none" and n in _OPTIONAL else v for n, v in values.items()}


def plain(settings: Settings) -> dict[str, Any]:
    """The settings as plain values, for `restored`."""
    values: dict[str, Any] = _ADAPTER.dump_python(settings, mode="json")
    return values


def restored(values: Mapping[str, Any]) -> Settings:
    """The settings from the values of `plain`.

    Raises:
        TrainingError: they are not valid settings.
    """
    try:
        return _ADAPTER.validate_python(dict(values)).check()
    except ValidationError as error:
        raise TrainingError("These settings are not valid:", *explain(error)) from error
