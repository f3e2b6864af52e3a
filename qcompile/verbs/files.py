"""Files that a verb writes, checked before anything long is run."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path

from qcompile.errors import OptionError, OutputError
from qcompile.output import resolved
from qcompile.sweep.arguments import Name


def path_of(name: Name | None) -> Path | None:
    """The path of a file that may not be named."""
    return None if name is None else Path(name)


def check_distinct(
    named: Mapping[str, Path | None], allowed: Container[frozenset[str]] = ()
) -> dict[Path, str]:
    """The options by the files they name, if no two name the same one but those of `allowed`.

    Raises:
        OptionError: two name the same file, by whatever path.
    """
    taken: dict[Path, str] = {}
    for option, path in named.items():
        if path is None:
            continue
        other = taken.setdefault(resolved(path), option)
        if other != option and frozenset({other, option}) not in allowed:
            raise OptionError(f"{path} is the file of {other} and of {option}.")
    return taken


def check_new(path: Path, option: str, force: bool, why: str = "") -> None:
    """Nothing, if there is no such file, or `force` lets it be overwritten.

    Raises:
        OutputError: there is; the message has `why`, and the option that would name another.
    """
    if path.is_file() and not force:
        advice = f"choose another with --{option}, or overwrite it with --force."
        words = f"{why}: {advice}" if why else advice.capitalize()
        raise OutputError(f"{path} is there already.", words)
