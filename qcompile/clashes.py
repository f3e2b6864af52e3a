"""Files that would overwrite one another: found by their names, before anything long is run."""

from __future__ import annotations

import os
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TypeAlias

from qcompile.errors import OptionError
from qcompile.output import resolved

Named: TypeAlias = Mapping[str, Path | Iterable[Path | None] | None]
"""Files by the words for them: one, several or none."""

_beside: ContextVar[tuple[Named, Named]] = ContextVar("beside", default=({}, {}))


@contextmanager
def beside(*, reads: Named | None = None, writes: Named | None = None) -> Iterator[None]:
    """Within the block, every check counts these files of the caller too."""
    read, written = _beside.get()
    token = _beside.set(({**read, **(reads or {})}, {**written, **(writes or {})}))
    try:
        yield
    finally:
        _beside.reset(token)


def check_clashes(
    reads: Named,
    writes: Named,
    *,
    folders: Container[str] = (),
    allowed: Container[frozenset[str]] = (),
) -> None:
    """Check that no file is written twice, is one that is read, or has another inside it.

    Links are followed, and so is case where the file system ignores it. `folders` are the words of
    the folders among `writes`, which may have files inside; pairs in `allowed` may be the same.

    Raises:
        OptionError: two names are the same file, or one is inside another.
    """
    read, written = _beside.get()
    taken: dict[str, list[tuple[str, Path]]] = {}
    for word, path in _pairs({**reads, **read}):
        taken.setdefault(_key(path), []).append((word, path))
    files: dict[str, str] = {}
    pairs = _pairs({**writes, **written})
    for word, path in pairs:
        key = _key(path)
        for other, known in taken.get(key, ()):
            if other != word and frozenset((other, word)) not in allowed and _same(known, path):
                raise OptionError(
                    f"{other} and {word} are the same file, {path}.",
                    "Each needs a file of its own.",
                )
        taken.setdefault(key, []).append((word, path))
        if word not in folders and not path.is_dir():
            files[key] = word
    for word, path in pairs:
        for outer in map(_key, resolved(path).parents):
            if outer in files:
                raise OptionError(f"{word}: {path} is inside {files[outer]}, a file.")


def _pairs(named: Named) -> list[tuple[str, Path]]:
    pairs = []
    for word, paths in named.items():
        several = [paths] if isinstance(paths, Path | None) else paths
        pairs += [(word, path) for path in several if path is not None]
    return pairs


def _key(path: Path) -> str:
    """The same for paths that are the same file on some file system."""
    return str(resolved(path)).casefold()


def _same(one: Path, other: Path) -> bool:
    """Whether two paths of one key are the same file here."""
    return resolved(one) == resolved(other) or ignores_case(resolved(other).parent)


def ignores_case(folder: Path) -> bool:
    """Whether the file system of a folder, which need not be there yet, ignores case."""
    there = next(each for each in (folder, *folder.parents) if os.path.lexists(each))
    try:
        with NamedTemporaryFile(dir=there, prefix=".case-") as file:
            name = Path(file.name)
            return name.with_name(name.name.upper()).exists()
    except OSError:  # nothing can be written there
        return False
