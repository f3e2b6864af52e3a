"""The studies: those shipped beside this file, and the user's TOML files."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

from qcompile.catalogue import close_names
from qcompile.errors import StudyError
from qcompile.sweep.arguments import Name
from qcompile.sweep.study.rows import Rows
from qcompile.sweep.study.rows_file import read_rows

BUILT_IN = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.toml"))}
"""The files of the shipped studies, by name."""

_SUFFIX = ".toml"


def open_study(name: Name) -> Rows:
    """The study of a name, or in a .toml file.

    Raises:
        StudyError: there is no such study, or the file is not one.
    """
    text = os.fspath(name)
    if text in BUILT_IN:
        return _built_in(text)
    path = Path(text)
    if path.suffix == _SUFFIX and os.path.lexists(text):
        return read_rows(path, text)
    known = {file.stem: str(file) for file in path.parent.glob(f"*{_SUFFIX}")} | {
        study: study for study in BUILT_IN
    }
    near = [known[stem] for stem in close_names(path.stem, known)]
    wrong_suffix = [f"The file {text} does not end with {_SUFFIX}."] * os.path.lexists(text)
    raise StudyError(
        f"There is no study {text!r}.",
        *wrong_suffix,
        f"A study is {' or '.join(BUILT_IN)}, or a {_SUFFIX} file of rows.",
        *([f"Did you mean {' or '.join(near)}?"] if near else []),
    )


def default_folder(name: Name) -> Path:
    """The default folder of a study: "study", or the name of its file."""
    text = os.fspath(name)
    return Path("study") if text in BUILT_IN else Path(Path(text).stem)


@cache
def _built_in(name: str) -> Rows:
    return read_rows(BUILT_IN[name], name)
