"""Check the files that a verb writes, before anything long is run."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path

from qcompile.errors import OptionError, OutputError
from qcompile.output import resolved
from qcompile.sweep.arguments import Name


def path_of(name: Name | None) -> Path | None:
    """The path of a file, None if no file is named."""
    return None if name is None else Path(name)


def check_distinct(
    named: Mapping[str, Path | None], allowed: Container[frozenset[str]] = ()
) -> dict[Path, str]:
    """Check that options name different files, except pairs in `allowed`; the options by file.

    Raises:
        OptionError: two options name the same file, even by different paths.
    """
    taken: dict[Path, str] = {}
    for option, path in named.items():
        if path is None:
            continue
        other = taken.setdefault(resolved(path), option)
        if other != option and frozenset({other, option}) not in allowed:
            raise OptionError(f"{other} and {option} are the same file, {path}.")
    return taken


def check_new(path: Path, option: str, force: bool, why: str = "") -> None:
    """Check that the file does not exist, or that `force` allows overwriting it.

    Raises:
        OutputError: it exists; the message has `why`, and the option that names another file.
    """
    if path.is_file() and not force:
        advice = f"choose another with --{option}, or overwrite it with --force."
        words = f"{why}: {advice}" if why else advice.capitalize()
        raise OutputError(f"{path} already exists.", words)
