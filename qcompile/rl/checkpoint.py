"""Checkpoint files: a training that goes on where it stopped, bit for bit."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qcompile.errors import EnvironmentStepError, QcompileError, TrainingError
from qcompile.output import write_file
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import plain, restored
from qcompile.rl.versions import versions
from qcompile.validation import Line, explain

FORMAT = "qcompile-checkpoint-1"

_TENSORS = ("actor", "critic", "optimiser", "generator", "pause")


class _Saved(BaseModel):
    """What a checkpoint file holds: `settings` and `plain` are JSON."""

    model_config = ConfigDict(strict=True)

    format: str
    environment: Line
    settings: str
    seed: Annotated[int, Field(ge=0)]
    versions: dict[str, str]
    tensors: dict[str, Any]
    plain: str


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
            "settings": json.dumps(plain(trainer.settings)),
            "seed": trainer.seed,
            "versions": versions(),
            "tensors": {name: state[name] for name in _TENSORS},
            "plain": json.dumps({k: v for k, v in state.items() if k not in _TENSORS}),
        },
        contents,
    )
    write_file(path, contents.getvalue())


def load_checkpoint(path: Path) -> tuple[Trainer, list[str]]:
    """The trainer of a checkpoint, ready to go on, and the versions that differ from its own.

    Nothing but tensors and plain values is loaded from the file.

    Raises:
        TrainingError: the file is no checkpoint of this version, or its training cannot go on.
        EnvironmentMismatchError: its environment is not known here.
    """
    saved = _read(path)
    try:
        trainer = Trainer(saved.environment, restored(json.loads(saved.settings)), saved.seed)
        trainer.restore({**saved.tensors, **json.loads(saved.plain)})
    except EnvironmentStepError as error:
        what = f"Checkpoint {path} is damaged, or its environment has changed."
        raise TrainingError(what, str(error).splitlines()[0]) from error
    except QcompileError:
        raise
    except Exception as error:  # wrong values lead torch and the environments into any error
        why = f"{type(error).__name__}: {error}".splitlines()[0]
        raise TrainingError(f"Checkpoint {path} is damaged.", why) from error
    now = versions()
    differ = [
        f"{name} {made} then, {now.get(name, 'none')} now"
        for name, made in saved.versions.items()
        if made != now.get(name)
    ]
    return trainer, differ


def _read(path: Path) -> _Saved:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch warns of odd pickle protocols
            saved = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise TrainingError(
            f"There is no checkpoint {path}.", "A training writes one with --checkpoint FILE."
        ) from error
    except Exception as error:  # wrong bytes lead torch's reader into errors of any type
        raise TrainingError(
            f"{path} is no checkpoint: it cannot be read as tensors and plain values.",
            "Name a file that `qcompile train --checkpoint` wrote, and wrote to its end.",
        ) from error
    found = saved.get("format") if isinstance(saved, dict) else type(saved).__name__
    if found != FORMAT:
        raise TrainingError(
            f"{path} is no checkpoint that this version reads: its format is {found!r}.",
            f"Needed: {FORMAT!r}, as `qcompile train --checkpoint` writes it.",
        )
    missing = sorted(set(_Saved.model_fields) - set(saved))
    if missing:
        raise TrainingError(f"Checkpoint {path} is damaged.", f"Missing: {', '.join(missing)}.")
    try:
        return _Saved.model_validate(saved)
    except ValidationError as error:
        raise TrainingError(f"Checkpoint {path} is damaged.", *explain(error)) from error
