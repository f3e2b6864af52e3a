"""Checkpoint files, from which a training resumes bit for bit."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from pydantic import ValidationError

from qcompile.deploy.environments import close_environments, features_and_actions
from qcompile.errors import (
    CircuitError,
    EnvironmentStepError,
    PolicyError,
    QcompileError,
    TrainingError,
)
from qcompile.limits import MAX_HISTORY_VALUES
from qcompile.output import write_file
from qcompile.policy import Ansatz
from qcompile.policy.ansatz_file import ansatz_text, read_ansatz
from qcompile.reading import ContentsError, load_json
from qcompile.rl.checkpoint_file import (
    ARGUMENTS,
    FORMAT,
    PlainState,
    Saved,
    TensorState,
    read_checkpoint,
)
from qcompile.rl.environments import training_environments
from qcompile.rl.models import critic_size, model_size
from qcompile.rl.models.wiring import reads_bits
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import PACKAGES, Settings, plain, restored
from qcompile.terminal import first_line
from qcompile.validation import explain
from qcompile.version import versions


def save_checkpoint(trainer: Trainer, path: Path, state: Mapping[str, Any] | None = None) -> None:
    """Write a state of the trainer, by default the current one, to `path`.

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
            "tensors": {name: state[name] for name in TensorState.model_fields},
            "plain": json.dumps({name: state[name] for name in PlainState.model_fields}),
        },
        contents,
    )
    write_file(path, contents.getvalue())


def load_checkpoint(path: Path) -> tuple[Trainer, list[str]]:
    """The trainer of a checkpoint, ready to resume, and the package versions that differ.

    Only tensors and plain values are loaded from the file, and models are built only if its tensors
    fit them.

    Raises:
        TrainingError: the file is not a checkpoint of this version, or cannot be resumed.
        EnvironmentMismatchError: its environment is unknown here.
    """
    saved = read_checkpoint(path)
    try:
        settings = restored(load_json(saved.settings))
        state = PlainState.model_validate(load_json(saved.plain, MAX_HISTORY_VALUES))
        arguments = ARGUMENTS.validate_python(load_json(saved.arguments))
        ansatz = _ansatz(saved.ansatz)
        _flatten_theta(saved.tensors)
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
    except Exception as error:  # wrong values cause all kinds of errors in torch and environments
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
    """The user's circuits, if there are any."""
    try:
        return None if text is None else read_ansatz(text)
    except (CircuitError, PolicyError) as error:
        raise ContentsError(first_line(str(error))) from error


def _flatten_theta(tensors: TensorState) -> None:
    """Make theta a vector: version 0.1.0 had that of an mvqc as (layers + 1, qubits, 2)."""
    average = tensors.average
    models = (tensors.actor, tensors.critic, tensors.pause.best, average and average.model)
    for model in models:
        if model and "theta" in model:
            model["theta"] = model["theta"].flatten()


def _check_sizes(
    settings: Settings,
    saved: Saved,
    state: PlainState,
    arguments: Mapping[str, Any],
    ansatz: Ansatz | None,
) -> None:
    """Raise ContentsError if the saved tensors do not match the settings."""
    for count in (len(state.collector.walks), len(state.return_scale.running)):
        if count != settings.environments:
            raise ContentsError(
                f"It has {count} environments; its settings say {settings.environments}."
            )
    if (ansatz is None) == (settings.layout == "own"):
        which = "no circuits" if ansatz is None else "circuits"
        raise ContentsError(f"It has {which}, but its settings have layout {settings.layout!r}.")
    bits = reads_bits(settings, ansatz)
    (environment,) = training_environments(saved.environment, 1, bits, arguments)
    features, actions = features_and_actions(environment)
    close_environments([environment])
    actor, best = saved.tensors.actor, saved.tensors.pause.best
    statistics = 2 * features * settings.normalise
    _check_model("actor", actor, model_size(settings, features, actions, ansatz) + statistics)
    _check_model("critic", saved.tensors.critic, critic_size(settings, features, ansatz))
    if best is not None and _shapes(best) != _shapes(actor):
        raise ContentsError("The tensors of its best actor do not match its actor.")
    average = saved.tensors.average
    if (average is not None) != (settings.average_share > 0):
        which = "no average" if average is None else "an average"
        raise ContentsError(
            f"It has {which}, but its settings have average_share {settings.average_share}."
        )
    if average is not None:
        _check_model("average", average.model, model_size(settings, features, actions, ansatz))


def _check_model(name: str, tensors: Mapping[str, torch.Tensor], size: int) -> None:
    count = sum(tensor.numel() for tensor in tensors.values())
    if count != size:
        raise ContentsError(f"Its {name} has {count:,} numbers; its settings need {size:,}.")
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
        raise ContentsError(f"Its {name} contains a number that is not finite.")


def _shapes(tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Size]:
    return {name: tensor.shape for name, tensor in tensors.items()}
