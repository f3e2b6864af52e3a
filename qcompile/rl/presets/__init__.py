"""The presets: settings for each model and environment, a TOML file each in this folder.

A table [MODEL.ENVIRONMENT] holds the differences from the defaults of `Settings`, or from an
earlier table named by `like`. `any` applies to environments without a table; "CartPole single" is
CartPole with the layout `single`. `like` of a whole [MODEL] copies the tables of an earlier model,
except those of a layout, and [MODEL.every] changes every table of its model. "none" means None.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from qcompile.errors import TrainingError
from qcompile.reading import ContentsError, read_toml
from qcompile.rl.settings import Settings, from_toml, restored
from qcompile.validation import explain

Family = dict[str, Settings]
"""The settings of a model by environment, its name without version; "" stands for any other."""

_ANY = "any"


class _ModelTables(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)
    __pydantic_extra__: dict[str, dict[str, Any]]

    like: str | None = None
    every: dict[str, Any] = {}


_FILE = TypeAdapter(dict[str, _ModelTables])


def read_preset(path: Path) -> dict[str, Family]:
    """The settings in a preset's file, by model and environment.

    Raises:
        TrainingError: the file cannot be read, or a table does not hold valid settings.
    """
    try:
        models = _FILE.validate_python(read_toml(path))
    except (OSError, ContentsError, ValidationError) as error:
        raise TrainingError(f"{path} is not a preset.", *explain(error)) from error
    tables: dict[tuple[str, str], dict[str, Any]] = {}
    families: dict[str, Family] = {}
    for model, written in models.items():
        inherited = {
            environment: {"like": f"{other}.{environment}"}
            for other, environment in tables
            if other == written.like and " " not in environment
        }
        if written.like is not None and not inherited:
            raise _not_above(path, model, written.like)
        families[model] = {}
        for environment, table in (inherited | written.__pydantic_extra__).items():
            name = f"{model}.{environment}"
            values = _with_inherited(path, name, table, tables) | written.every
            tables[model, environment] = values
            families[model]["" if environment == _ANY else environment] = _settings(
                path, name, values | {"model": model}
            )
        if "" not in families[model]:
            raise TrainingError(f"{path} has no table [{model}.{_ANY}].")
    return families


def _with_inherited(
    path: Path, name: str, table: dict[str, Any], tables: dict[tuple[str, str], dict[str, Any]]
) -> dict[str, Any]:
    """The values of a table, merged over those of the table named by `like`."""
    written = {key: value for key, value in table.items() if key != "like"}
    if "like" not in table:
        return written
    model, _, environment = str(table["like"]).partition(".")
    if (model, environment) not in tables:
        raise _not_above(path, name, table["like"])
    return tables[model, environment] | written


def _not_above(path: Path, name: str, like: object) -> TrainingError:
    return TrainingError(f"{path}: [{name}] is like {like!r}, but there is no such table above it.")


def _settings(path: Path, name: str, values: dict[str, Any]) -> Settings:
    try:
        return restored(from_toml(values))
    except TrainingError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        raise TrainingError(f"{path}: [{name}] does not hold valid settings.", *lines) from error


PRESETS = {path.stem: read_preset(path) for path in sorted(Path(__file__).parent.glob("*.toml"))}
"""Settings by preset, model and environment (its name without version); "" is any other."""


def settings_for(
    preset: str, environment: str, model: str = "svqc", layout: str = "parallel"
) -> Settings:
    """The settings of a preset for an environment, a model and, for svqc, a layout.

    Raises:
        TrainingError: there is no such preset, or it has no settings for the model or its layout.
    """
    if preset not in PRESETS:
        raise TrainingError(f"Unknown preset {preset!r}.", f"Known: {', '.join(PRESETS)}.")
    models = PRESETS[preset]
    if model not in models:
        raise TrainingError(
            f"Preset {preset!r} has no settings for model {model!r}.",
            f"It has: {', '.join(models)}.",
        )
    name = environment.rsplit("-v", 1)[0]
    family = models[model]
    settings = family.get(f"{name} {layout}") or family.get(name) or family[""]
    return settings if settings.layout == layout else settings.changed(layout=layout)
