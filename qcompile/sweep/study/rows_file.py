"""Rows as data: a TOML file of figures, each with its environment, its target and its rows.

A row is named FIGURE-MODEL-VARIANT-PRESET. Its settings are the preset's for its model, its layout
and the environment of its figure, with what its own `settings` change.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qcompile.errors import StudyError, TrainingError
from qcompile.reading import ContentsError, read_toml
from qcompile.rl.presets import settings_for
from qcompile.rl.settings import from_toml
from qcompile.sweep.study.rows import Claim, Row
from qcompile.validation import explain

Natural = Annotated[int, Field(ge=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _RowTable(_Table):
    title: str
    model: str
    preset: str
    layout: str = "parallel"
    variant: str = ""
    seeds: Natural = 5
    target: float | None = None
    claim: str = "-"
    claim_episodes: Natural | None = None
    settings: dict[str, Any] = {}


class _FigureTable(_Table):
    title: str
    environment: str
    target: float
    also: list[str] = []
    rows: Annotated[list[_RowTable], Field(min_length=1)]


class _File(_Table):
    figures: Annotated[dict[str, _FigureTable], Field(min_length=1)]


@dataclass(frozen=True)
class Figure:
    """A figure of a study; `also` names the rows of other figures that it shows as well."""

    title: str
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class RowsFile:
    """The figures of a study by name, and its rows in the order of the figures."""

    figures: dict[str, Figure]
    rows: tuple[Row, ...]


def read_rows(path: Path) -> RowsFile:
    """The figures and rows in a file.

    Raises:
        StudyError: the file cannot be read, or a row of it holds no settings.
    """
    try:
        tables = _File.model_validate(read_toml(path)).figures
    except (OSError, ContentsError, ValidationError) as error:
        raise StudyError(f"{path} is not a file of rows.", *explain(error)) from error
    return RowsFile(
        {name: Figure(table.title, tuple(table.also)) for name, table in tables.items()},
        tuple(_row(path, name, table, row) for name, table in tables.items() for row in table.rows),
    )


def _row(path: Path, figure: str, shared: _FigureTable, table: _RowTable) -> Row:
    name = "-".join(filter(None, (figure, table.model, table.variant, table.preset)))
    try:
        preset = settings_for(table.preset, shared.environment, table.model, table.layout)
        settings = preset.changed(**from_toml(table.settings))
    except TrainingError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        raise StudyError(f"{path}: the row {name} does not hold settings.", *lines) from error
    return Row(
        name=name,
        title=table.title,
        figure=figure,
        environment=shared.environment,
        preset=table.preset,
        settings=settings,
        seeds=table.seeds,
        target=shared.target if table.target is None else table.target,
        claim=Claim(table.claim, table.claim_episodes),
    )
