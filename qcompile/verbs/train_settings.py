"""The settings of a training: a preset with changes, or those of a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from qcompile.caller import option
from qcompile.device import IDEAL_NAME, load_device
from qcompile.errors import OptionError, TrainingError
from qcompile.policy import Ansatz, AnyPolicy, Network, Policy, load_ansatz, load_policy
from qcompile.policy.arguments import check_env
from qcompile.sweep.arguments import Name, Words

if TYPE_CHECKING:
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.settings import Settings

NOISY_SHOTS = 1024
"""The default shots on a noisy backend."""
MODEL, PRESET, LAYOUT, SEED = "svqc", "tuned", "parallel", 0
"""The defaults."""

_PRESET_OF = ("model", "layout")

_NOT_WITH = {"circuits": ("init", "layout"), "init": ("layout", "reuse")}
_WHY = {
    "init": "The first trains a new head, the second starts from the policy's own.",
    "layout": "The circuits come from the file or the object.",
    "reuse": "The policy already has a head, which is trained further.",
}


@dataclass(frozen=True, kw_only=True)
class TrainingRequest:
    """The arguments of `train` about what is trained; None for the default."""

    environment: str
    model: str | None = None
    preset: str | None = None
    layout: str | None = None
    reuse: int | None = None
    seed: int | None = None
    episodes: int | None = None
    steps: int | None = None
    backend: Name | None = None
    shots: int | Literal["exact"] | None = None
    mitigation: str | None = None
    hold: int | None = None
    circuits: Any = None
    init: Name | AnyPolicy | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    env: Mapping[str, Any] = field(default_factory=dict)

    def trainer(self) -> Trainer:
        """A new trainer with the settings of the preset, changed by the other arguments.

        Raises:
            OptionError: a setting is unknown or given twice; `env` cannot be saved in a policy.
            QcompileError: the settings do not fit each other, or there is no such device.
        """
        from qcompile.rl.models import NetworkModel
        from qcompile.rl.ppo import Trainer

        check_env(self.env, for_file=True)
        start = None if self.init is None else load_policy(self.init)
        self._check_options()
        ansatz, env = None, self.env
        if self.circuits is not None:
            ansatz = load_ansatz(self.circuits)
        elif isinstance(start, Policy):
            ansatz = Ansatz.of_policy(start, head=True)
        if start is not None and start.environment == self.environment:
            env = {**start.environment_kwargs, **env}
        settings, seed = self._settings(ansatz, start), SEED if self.seed is None else self.seed
        trainer = Trainer(self.environment, settings, seed, arguments=env, ansatz=ansatz)
        if isinstance(start, Network):
            assert isinstance(trainer.actor, NetworkModel)
            trainer.actor.take(start)
        return trainer

    @property
    def _start_name(self) -> str:
        return "circuits" if self.circuits is not None else "init"

    def _check_options(self) -> None:
        """Raise OptionError if circuits or init are combined with what they already determine."""
        if getattr(self, self._start_name) is None:
            return
        for other in _NOT_WITH[self._start_name]:
            if getattr(self, other) is not None or other in self.settings:
                raise OptionError(
                    f"{option(self._start_name)} and {option(other)} cannot be combined.",
                    _WHY[other],
                )

    def _model(self, ansatz: Ansatz | None, network: Network | None) -> str:
        """The model's name: that of the circuits or layers, if there are any.

        Raises:
            OptionError: another one is given.
        """
        from qcompile.rl.models import model_of

        if network is not None:
            model = network.model
        elif ansatz is not None:
            model = model_of(ansatz)
        else:
            return self.model or MODEL
        if self.model not in (None, model):
            raise OptionError(
                f"{option(self._start_name)} and {option('model')} {self.model!r} cannot be "
                "combined.",
                f"These circuits or layers have model {model}.",
            )
        return model

    def _settings(self, ansatz: Ansatz | None, start: AnyPolicy | None) -> Settings:
        from qcompile.rl.models import settings_of
        from qcompile.rl.presets import settings_for

        network = start if isinstance(start, Network) else None
        model = self._model(ansatz, network)
        settings = settings_for(
            self.preset or PRESET, self.environment, model, self.layout or LAYOUT
        )
        if network is not None:
            settings = settings.changed(**settings_of(network))
        changed = self._named_settings()
        if start is not None and start.hold > 1:
            changed = {"hold": start.hold} | changed
        if ansatz is not None:  # a preset's scales are those of its layout
            changed = {"scales": (1.0,)} | changed | {"layout": "own"}
        if self.episodes is not None or self.steps is not None:
            changed = {"episodes": self.episodes, "steps": self.steps} | changed
        if self.backend is not None:
            noisy = not load_device(fspath(self.backend)).is_ideal
            changed["backend"] = fspath(self.backend) if noisy else IDEAL_NAME
            if noisy:
                changed = {"shots": NOISY_SHOTS, "mitigation": "readout"} | changed
        if self.shots is not None:
            changed["shots"] = None if self.shots == "exact" else self.shots
        for name in ("reuse", "mitigation", "hold"):
            if (value := getattr(self, name)) is not None:
                changed[name] = value
        return settings.changed(**changed)

    def _named_settings(self) -> dict[str, Any]:
        """The settings given by name; `Settings.changed` checks their values."""
        from qcompile.rl.settings import SETTING_NAMES, nearest_setting

        for name in self.settings:
            if name not in SETTING_NAMES:
                raise OptionError(f"Unknown setting {name!r}.", nearest_setting(name))
            if name in _PRESET_OF:
                raise OptionError(
                    f"{name!r} cannot be changed as a setting: the preset depends on it.",
                    f"Use the option {option(name)}.",
                )
            if getattr(self, name, None) is not None:
                raise OptionError(f"{option(name)} is given twice, as an option and as a setting.")
        return dict(self.settings)

    def resumed(self, checkpoint: Path, on_note: Words) -> Trainer:
        """The trainer of a checkpoint; the arguments must agree with it.

        Raises:
            OptionError: an argument would change settings.
            TrainingError: the file is not a checkpoint, or has another environment, model, seed or
                hold.
        """
        from qcompile.rl.checkpoint import load_checkpoint

        names = ("environment", "model", "seed", "hold")
        given = (name for name, value in vars(self).items() if value and name not in names)
        options = [*map(option, given)]
        if options:
            raise OptionError(
                f"{' and '.join(options)} cannot be combined with {option('resume')}: "
                "the settings come from the checkpoint."
            )
        trainer, differ = load_checkpoint(checkpoint)
        settings = trainer.settings
        saved = (trainer.environment, settings.model, trainer.seed, settings.hold)
        for name, value in zip(names, saved, strict=True):
            argument = getattr(self, name)
            if argument is not None and argument != value:
                raise TrainingError(
                    f"Checkpoint {checkpoint} has {name} {value!r}, not {argument!r}.",
                    f"Use {value}, or resume another checkpoint.",
                )
        if differ:
            on_note(
                f"Warning: {checkpoint} was made with other versions ({'; '.join(differ)}). "
                "The resumed training may differ slightly from an uninterrupted one."
            )
        return trainer
