"""Read a study from a TOML file of figures, each with an environment and rows.

A row is named FIGURE-MODEL-VARIANT-PRESET. Its settings are those of the preset for its model, its
layout and the environment of its figure, changed by its own `settings`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
)

from qcompile.catalogue import nearest
from qcompile.errors import StudyError, TrainingError
from qcompile.policy.arguments import check_arguments
from qcompile.reading import ContentsError, read_toml
from qcompile.rl.presets import settings_for
from qcompile.rl.settings import from_toml
from qcompile.sweep.study.rows import Claim, ClaimSeed, Figure, Row, Rows
from qcompile.validation import Line, explain

_MOST_SEEDS = 1000
_PRESET_OF = ("model", "layout")
_WORDS = {
    "extra_forbidden": "there is no such key",
    "missing": "this key is required",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "list_type": "must be a list",
}


def _file_name(name: str) -> str:
    """Check that a name can be part of a file name."""
    if name and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,59}", name):
        raise ValueError(
            "used in file names: up to 60 letters, digits, '.', '-' and '_', with a letter or "
            "digit first"
        )
    return name


def _seeds(seeds: Any) -> tuple[int, ...]:
    """The seeds of a number of seeds, or of a list."""
    if type(seeds) is int and 1 <= seeds <= _MOST_SEEDS:
        return tuple(range(seeds))
    whole = isinstance(seeds, list) and all(type(s) is int and 0 <= s < 2**63 for s in seeds)
    if not whole or not 1 <= len(set(seeds)) == len(seeds) <= _MOST_SEEDS:
        raise ValueError(
            f"must be a number from 1 to {_MOST_SEEDS}, or a list of different seeds from 0 up"
        )
    return tuple(seeds)


Natural = Annotated[int, Field(ge=1, le=1_000_000_000)]
_FileName = Annotated[str, AfterValidator(_file_name)]
_Title = Annotated[Line, Field(max_length=100)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _RowTable(_Table):
    title: _Title | None = None
    group: _Title | None = None
    model: str = "svqc"
    preset: str = "tuned"
    layout: str = "parallel"
    variant: _FileName = ""
    seeds: Annotated[tuple[int, ...], BeforeValidator(_seeds)] = tuple(range(5))
    target: float | None = None
    episodes: Natural | None = None
    steps: Natural | None = None
    hold: Natural | None = None
    claim: Line | None = None
    claim_episodes: Natural | None = None
    claim_seed: ClaimSeed = "mean"
    settings: dict[str, Any] = {}


class _FigureTable(_Table):
    title: _Title | None = None
    environment: str
    env: Annotated[dict[str, JsonValue], AfterValidator(check_arguments)] = {}
    target: float | None = None
    also: list[str] = []
    last_episode: Natural | None = None
    rows: Annotated[list[_RowTable], Field(min_length=1)]


class _File(_Table):
    title: _Title | None = None
    about: Annotated[str, Field(max_length=10_000)] = ""
    figures: Annotated[dict[_FileName, _FigureTable], Field(min_length=1)]


def read_rows(path: Path, name: str) -> Rows:
    """Read the study in a file; `name` is its name on the command line.

    Raises:
        StudyError: the file cannot be read, the settings of a row are invalid, or two rows have the
            same name or label.
    """
    try:
        file = _File.model_validate(read_toml(path))
    except ValidationError as error:
        raise StudyError(f"{path} is not a study.", *_faults(error)) from error
    except (OSError, ContentsError) as error:
        raise StudyError(f"{path} is not a study.", *explain(error)) from error
    study = Rows(
        name,
        file.title or path.stem,
        file.about.strip(),
        {
            name: Figure(table.title or table.environment, tuple(table.also), table.last_episode)
            for name, table in file.figures.items()
        },
        tuple(
            _row(path, name, table, row)
            for name, table in file.figures.items()
            for row in table.rows
        ),
    )
    _check_names(path, study)
    return study


def _faults(error: ValidationError) -> list[str]:
    """The errors in the file, with the nearest valid key for the first unknown one."""
    lines = [line.replace(".[key]:", ":") for line in explain(error, words=_WORDS)]
    for fault in error.errors(include_url=False):
        if fault["type"] == "extra_forbidden":
            *place, key = fault["loc"]
            tables: dict[int, type[_Table]] = {0: _File, 2: _FigureTable}
            return [*lines, nearest(str(key), tables.get(len(place), _RowTable).model_fields)]
    return lines


def _row(path: Path, figure: str, shared: _FigureTable, table: _RowTable) -> Row:
    name = "-".join(filter(None, (figure, table.model, table.variant, table.preset)))
    try:
        changes = _changes(table)
        preset = settings_for(table.preset, shared.environment, table.model, table.layout)
        settings = preset.changed(**from_toml(changes))
    except TrainingError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        raise StudyError(f"{path}: the settings of row {name} are invalid.", *lines) from error
    layout = "" if table.layout == "parallel" else table.layout
    title = table.title or ", ".join(filter(None, (table.model, layout, table.variant)))
    target = shared.target if table.target is None else table.target
    claimed = table.claim_episodes
    if claimed is not None and target is None:
        raise StudyError(
            f"{path}: the row {name} has claim_episodes but no target.",
            "claim_episodes counts episodes to a target: set target in the row or in its figure.",
        )
    return Row(
        name=name,
        title=title,
        group=table.group or title,
        figure=figure,
        environment=shared.environment,
        arguments=shared.env,
        preset=table.preset,
        settings=settings,
        changes={name: value for name, value in changes.items() if value is not None},
        seeds=table.seeds,
        target=target,
        claim=Claim(
            table.claim or ("-" if claimed is None else f"{claimed:,} episodes"),
            claimed,
            table.claim_seed,
        ),
    )


def _changes(table: _RowTable) -> dict[str, Any]:
    """The changes that a row makes to its preset.

    Raises:
        TrainingError: the settings have a key that belongs to the row.
    """
    budget = {"episodes": table.episodes, "steps": table.steps}
    if budget == {"episodes": None, "steps": None}:
        budget = {}
    hold = {} if table.hold is None else {"hold": table.hold}
    for key in table.settings:
        if key in _PRESET_OF or key in budget or key in hold:
            raise TrainingError(
                f"settings has {key!r}, which is a key of the row.",
                f"Write it in the row, beside settings: {key} = ...",
            )
    layout = {} if table.layout == "parallel" else {"layout": table.layout}
    return layout | budget | hold | table.settings


def _check_names(path: Path, study: Rows) -> None:
    """Raise StudyError if two rows or figures have the same name, or the same label."""
    names = [row.name for row in study.rows]
    if twice := _twice(names):
        raise StudyError(
            f"{path}: two rows are named {twice}.",
            "A row is named FIGURE-MODEL-VARIANT-PRESET: give each another variant.",
        )
    if twice := _twice(study.figures):
        raise StudyError(
            f"{path}: two figures are named {twice}.",
            "File names must differ in more than upper and lower case.",
        )
    for figure, shown in study.figures.items():
        for other in shown.also:
            if other not in names:
                raise StudyError(
                    f"{path}: figures.{figure}.also names {other!r}, which is not a row.",
                    nearest(other, names),
                )
        labels = [f"{r.title}, {r.preset}" for r in study.rows if study.belongs(r, figure)]
        if twice := _twice(labels):
            raise StudyError(
                f"{path}: figures.{figure} has two rows {twice!r}.",
                "In its table rows must differ in title or preset: give each another title.",
            )


def _twice(names: Iterable[str]) -> str | None:
    """A name that occurs twice, ignoring case, as some file systems do."""
    counts = Counter(name.casefold() for name in names)
    return next((name for name, count in counts.items() if count > 1), None)
