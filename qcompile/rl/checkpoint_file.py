"""The schema of checkpoint files, format qcompile-checkpoint-1."""

from __future__ import annotations

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
    model_validator,
)

from qcompile.errors import TrainingError
from qcompile.limits import MAX_CHECKPOINT_BYTES
from qcompile.policy.arguments import check_arguments
from qcompile.reading import ContentsError, read_file, read_torch
from qcompile.validation import Finite, Line, explain

FORMAT = "qcompile-checkpoint-1"

ARGUMENTS = TypeAdapter(Annotated[dict[str, JsonValue], AfterValidator(check_arguments)])
"""Valid environment arguments of a checkpoint, as of a policy file: nothing that loads code."""

_Whole = Annotated[int, Field(ge=0, le=2**53)]
_NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _PauseState(BaseModel):
    """The state of a `Pause`."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    running: list[float]
    row: _Whole
    longest: _Whole
    best: dict[str, torch.Tensor] | None


class _AverageState(BaseModel):
    """The state of an `Average`."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    updates: _Whole
    model: dict[str, torch.Tensor]


class TensorState(BaseModel):
    """The tensors of a trainer's state; files of version 0.1.0 lack average and memory."""

    model_config = ConfigDict(strict=True, arbitrary_types_allowed=True)

    actor: dict[str, torch.Tensor]
    critic: dict[str, torch.Tensor]
    optimiser: dict[str, Any]
    generator: torch.Tensor
    pause: _PauseState
    average: _AverageState | None = None
    memory: list[dict[str, torch.Tensor]] = []


class _CollectorState(BaseModel):
    """The state of a `Collector`."""

    rng: dict[str, Any]
    steps: _Whole
    decisions: _Whole
    episodes: list[tuple[_Whole, Finite, _Whole]]
    walks: list[tuple[_Whole, list[_Whole]]]
    observations: list[list[Finite]]

    @model_validator(mode="before")
    @classmethod
    def _from_version_0_1_0(cls, values: Any) -> Any:
        """Fill in `decisions` in a file of version 0.1.0, where every step was a decision."""
        if not isinstance(values, dict) or "decisions" in values or "steps" not in values:
            return values
        episodes = values.get("episodes")
        if isinstance(episodes, list):
            episodes = [[*e, e[0]] if isinstance(e, list) and len(e) == 2 else e for e in episodes]
        return values | {"decisions": values["steps"], "episodes": episodes}


class _ReturnScaleState(BaseModel):
    """The state of a `ReturnScale`."""

    running: list[Finite]
    moments: tuple[_NotNegative, Finite, _NotNegative]


class _NormaliserState(BaseModel):
    """The state of a `Normaliser`."""

    count: _NotNegative
    mean: list[Finite]
    var: list[_NotNegative]


class PlainState(BaseModel):
    """The plain values of a trainer's state."""

    rng: dict[str, Any]
    collector: _CollectorState
    return_scale: _ReturnScaleState
    noise: dict[str, Any] | None
    normaliser: _NormaliserState | None = None


class Saved(BaseModel):
    """The contents of a checkpoint file.

    `arguments` of the environment, `ansatz` (the user's circuits), `settings` and `plain`, a
    `PlainState`, are JSON. Files of version 0.1.0 lack the first two.
    """

    model_config = ConfigDict(strict=True)

    format: str
    environment: Line
    arguments: str = "{}"
    ansatz: str | None = None
    settings: str
    seed: Annotated[int, Field(ge=0)]
    versions: dict[Line, Line]
    tensors: TensorState
    plain: str


def read_checkpoint(path: Path) -> Saved:
    """The contents of the file at `path`, with its JSON not yet parsed.

    Raises:
        TrainingError: the file is not a checkpoint of this version.
    """
    try:
        saved = read_torch(read_file(path, MAX_CHECKPOINT_BYTES))
    except FileNotFoundError as error:
        raise TrainingError(
            f"There is no checkpoint {path}.", "`qcompile train --checkpoint FILE` writes one."
        ) from error
    except (OSError, ContentsError) as error:
        raise TrainingError(
            f"{path} is not a checkpoint: it cannot be read as tensors and plain values.",
            *explain(error),
            "Name a complete file written by `qcompile train --checkpoint`.",
        ) from error
    format_ = saved.get("format") if isinstance(saved, dict) else type(saved).__name__
    if format_ != FORMAT:
        raise TrainingError(
            f"{path} is not a checkpoint that this version can read; "
            f"its format is {ascii(format_)[:60]}.",
            f"It must be {FORMAT!r}, as written by `qcompile train --checkpoint`.",
        )
    needed = {name for name, field in Saved.model_fields.items() if field.is_required()}
    missing = sorted(needed - set(saved))
    if missing:
        raise TrainingError(f"Checkpoint {path} is damaged.", f"Missing: {', '.join(missing)}.")
    try:
        return Saved.model_validate(saved)
    except ValidationError as error:
        raise TrainingError(f"Checkpoint {path} is damaged.", *explain(error, 1)) from error
