"""Checkpoint files: a training that resumes where it stopped, bit for bit."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    JsonValue,
    TypeAdapter,
    ValidationError,
)

from qcompile.deploy.environments import (
    close_environments,
    features_and_actions,
)
from qcompile.errors import (
    CircuitError,
    EnvironmentStepError,
    PolicyError,
    QcompileError,
    TrainingError,
)
from qcompile.limits import MAX_CHECKPOINT_BYTES, MAX_HISTORY_VALUES
from qcompile.output import write_file
from qcompile.policy import Ansatz
from qcompile.policy.ansatz_file import ansatz_text, read_ansatz
from qcompile.policy.arguments import check_arguments
from qcompile.reading import ContentsError, load_json, read_file, read_torch
from qcompile.rl.models import critic_size, model_size
from qcompile.rl.models.wiring import reads_bits
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import PACKAGES, Settings, plain, restored
from qcompile.rl.worlds import training_environments
from qcompile.terminal import first_line
from qcompile.validation import Finite, Line, explain
from qcompile.version import versions

FORMAT = "qcompile-checkpoint-1"

_TENSORS = ("actor", "critic", "optimiser", "generator", "pause", "average", "memory")


_ARGUMENTS = TypeAdapter(Annotated[dict[str, JsonValue], AfterValidator(check_arguments)])
"""A checkpoint's environment takes what that of a policy file may: nothing that loads code."""

Whole = Annotated[int, Field(ge=0, le=2**53)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Saved(BaseModel):
    """What a checkpoint file holds: `settings`, `plain`, `arguments`, those of the environment, and
    `ansatz`, circuits of one's own, are JSON; a file of version 0.1.0 has none of the latter."""

    model_config = ConfigDict(strict=True)

    format: str
    environment: Line
    arguments: str = "{}"
    ansatz: str | None = None
    settings: str
    seed: Annotated[int, Field(ge=0)]
    versions: dict[Line, Line]
    tensors: _Tensors
    plain: str


class _Paused(BaseModel):
    """The state of a `Pause`."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    running: list[float]
    row: Whole
    longest: Whole
    best: dict[str, torch.Tensor] | None


class _Averaged(BaseModel):
    """The state of an `Average`."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    updates: Whole
    model: dict[str, torch.Tensor]


class _Tensors(BaseModel):
    """The tensors of a trainer's state, by their names in torch's state dicts."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    actor: dict[str, torch.Tensor]
    critic: dict[str, torch.Tensor]
    optimiser: dict[str, Any]
    generator: torch.Tensor
    pause: _Paused
    average: _Averaged | None = None
    memory: list[dict[str, torch.Tensor]] = []
    """Files of versions before these have neither."""


class _Collected(BaseModel):
    """The state of a `Collector`."""

    rng: dict[str, Any]
    steps: Whole
    episodes: list[tuple[Whole, Finite]]
    walks: list[tuple[Whole, list[Whole]]]
    observations: list[list[Finite]]


class _Scaled(BaseModel):
    """The state of a `ReturnScale`."""

    running: list[Finite]
    moments: tuple[NotNegative, Finite, NotNegative]


class _Normalised(BaseModel):
    """The state of a `Normaliser`."""

    count: NotNegative
    mean: list[Finite]
    var: list[NotNegative]


class _Plain(BaseModel):
    """The plain values of a trainer's state."""

    rng: dict[str, Any]
    collector: _Collected
    return_scale: _Scaled
    noise: dict[str, Any] | None
    normaliser: _Normalised | None = None


def save_checkpoint(trainer: Trainer, path: Path, state: Mapping[str, Any] | None = None) -> None:
    """Write a state of the trainer, the present one unless another is given, to `path`.

    Raises:
        OutputError: the file cannot be written.
    """
    state = trainer.state() if state is None else state
    contents = io.BytesIO()
    torch.save(
        {
            "format": FORMAT,
            "environment": trainer.environment,
            "arguments": json.dumps(trainer.arguments),
            "ansatz": None if trainer.ansatz is None else ansatz_text(trainer.ansatz),
            "settings": json.dumps(plain(trainer.settings)),
            "seed": trainer.seed,
            "versions": versions(*PACKAGES),
            "tensors": {name: state[name] for name in _TENSORS},
            "plain": json.dumps({k: v for k, v in state.items() if k not in _TENSORS}),
        },
        contents,
    )
    write_file(path, contents.getvalue())


def identity(path: Path) -> tuple[str, Mapping[str, Any], Settings, int]:
    """Environment, its arguments, settings and seed of the training that wrote a checkpoint.

    Raises:
        TrainingError: the file is not a checkpoint of this version.
    """
    saved = _read(path)
    try:
        arguments = _ARGUMENTS.validate_python(load_json(saved.arguments))
        return saved.environment, arguments, restored(load_json(saved.settings)), saved.seed
    except (ContentsError, ValidationError) as error:
        raise TrainingError(f"Checkpoint {path} is damaged.", *explain(error, 1)) from error


def load_checkpoint(path: Path) -> tuple[Trainer, list[str]]:
    """The trainer of a checkpoint, ready to resume, and the versions that differ from its own.

    Nothing but tensors and plain values is loaded from the file, and its models are built only
    where its tensors fit them.

    Raises:
        TrainingError: the file is not a checkpoint of this version, or cannot be resumed.
        EnvironmentMismatchError: its environment is not known here.
    """
    saved = _read(path)
    try:
        settings = restored(load_json(saved.settings))
        state = _Plain.model_validate(load_json(saved.plain, MAX_HISTORY_VALUES))
        arguments = _ARGUMENTS.validate_python(load_json(saved.arguments))
        ansatz = _ansatz(saved.ansatz)
        _check_sizes(settings, saved, state, arguments, ansatz)
        trainer = Trainer(
            saved.environment, settings, saved.seed, arguments=arguments, ansatz=ansatz
        )
        trainer.restore({**saved.tensors.model_dump(), **state.model_dump()})
    except EnvironmentStepError as error:
        what = f"Checkpoint {path} is damaged, or its environment has changed."
        raise TrainingError(what, first_line(str(error))) from error
    except QcompileError:
        raise
    except (ContentsError, ValidationError) as error:
        raise TrainingError(f"Checkpoint {path} is damaged.", *explain(error, 1)) from error
    except Exception as error:  # wrong values lead torch and the environments into any error
        why = first_line(f"{type(error).__name__}: {error}")
        raise TrainingError(f"Checkpoint {path} is damaged.", why) from error
    now = versions(*PACKAGES)
    differ = [
        f"{name} {version} then, {now.get(name, 'none')} now"
        for name, version in saved.versions.items()
        if version != now.get(name)
    ]
    return trainer, differ


def _ansatz(text: str | None) -> Ansatz | None:
    """The circuits of one's own, if there are any."""
    try:
        return None if text is None else read_ansatz(text)
    except (CircuitError, PolicyError) as error:
        raise ContentsError(first_line(str(error))) from error


def _check_sizes(
    settings: Settings,
    saved: _Saved,
    state: _Plain,
    arguments: Mapping[str, Any],
    ansatz: Ansatz | None,
) -> None:
    """Raise ContentsError where the trainer that the settings ask for is not the one saved."""
    for count in (len(state.collector.walks), len(state.return_scale.running)):
        if count != settings.environments:
            raise ContentsError(
                f"It has {count} environments, by its settings {settings.environments}."
            )
    bits = reads_bits(settings, ansatz)
    (environment,) = training_environments(saved.environment, 1, bits, arguments)
    features, actions = features_and_actions(environment)
    close_environments([environment])
    actor, best = saved.tensors.actor, saved.tensors.pause.best
    statistics = 2 * features * settings.normalise
    _check_model("actor", actor, model_size(settings, features, actions, ansatz) + statistics)
    _check_model("critic", saved.tensors.critic, critic_size(settings, features, ansatz))
    if best is not None and _shapes(best) != _shapes(actor):
        raise ContentsError("Its best actor has other tensors than its actor.")
    average = saved.tensors.average
    if (average is not None) != (settings.average_share > 0):
        found = "no average" if average is None else "an average"
        raise ContentsError(f"It has {found}, by its settings a share of {settings.average_share}.")
    if average is not None:
        _check_model("average", average.model, model_size(settings, features, actions, ansatz))


def _check_model(name: str, tensors: Mapping[str, torch.Tensor], size: int) -> None:
    count = sum(tensor.numel() for tensor in tensors.values())
    if count != size:
        raise ContentsError(f"Its {name} has {count:,} numbers, by its settings {size:,}.")
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
        raise ContentsError(f"Its {name} has a number that is not finite.")


def _shapes(tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Size]:
    return {name: tensor.shape for name, tensor in tensors.items()}


def _read(path: Path) -> _Saved:
    try:
        saved = read_torch(read_file(path, MAX_CHECKPOINT_BYTES))
    except FileNotFoundError as error:
        raise TrainingError(
            f"There is no checkpoint {path}.", "A training writes one with --checkpoint FILE."
        ) from error
    except (OSError, ContentsError) as error:
        raise TrainingError(
            f"{path} is not a checkpoint: it cannot be read as tensors and plain values.",
            *explain(error),
            "Name a file that `qcompile train --checkpoint` wrote, and wrote to its end.",
        ) from error
    format_ = saved.get("format") if isinstance(saved, dict) else type(saved).__name__
    if format_ != FORMAT:
        raise TrainingError(
            f"{path} is not a checkpoint that this version reads; "
            f"its format is {ascii(format_)[:60]}.",
            f"Needed: {FORMAT!r}, as `qcompile train --checkpoint` writes it.",
        )
    missing = sorted(set(_Saved.model_fields) - {"arguments", "ansatz"} - set(saved))
    if missing:
        raise TrainingError(f"Checkpoint {path} is damaged.", f"Missing: {', '.join(missing)}.")
    try:
        return _Saved.model_validate(saved)
    except ValidationError as error:
        raise TrainingError(f"Checkpoint {path} is damaged.", *explain(error, 1)) from error
