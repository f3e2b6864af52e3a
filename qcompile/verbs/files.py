"""The files that a verb reads and writes, checked before anything long is run."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from qcompile.caller import option
from qcompile.errors import OutputError


def path_of(name: object) -> Path | None:
    """The path of a file; None for an object, or if no file is named."""
    return Path(name) if isinstance(name, str | PathLike) else None


def check_new(path: Path, name: str, force: bool, why: str = "") -> None:
    """Check that the file does not exist, or that `force` allows overwriting it.

    Raises:
        OutputError: it exists; the message has `why`, and `name`, the option that names another.
    """
    if path.is_file() and not force:
        advice = f"choose another with {option(name)}, or overwrite it with {option('force')}."
        words = f"{why}: {advice}" if why else advice.capitalize()
        raise OutputError(f"{path} already exists.", words)
