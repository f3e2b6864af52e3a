"""Regular files, of a size that their kind can have."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from qcompile.limits import MAX_FILE_BYTES


class ContentsError(ValueError):
    """What is wrong with the contents of a file, in words."""


def read_file(path: str | Path, most: int = MAX_FILE_BYTES) -> bytes:
    """The contents of the regular file at `path`, at most `most` bytes.

    A pipe, a device, a socket or a folder is refused before anything is read: it may never end.

    Raises:
        ContentsError: it is not a regular file, or too large.
        OSError: it cannot be opened or read.
    """
    if "\0" in str(path):
        raise ContentsError("A path has no NUL character.")
    _check_regular(os.stat(path))  # opening a device may already move it
    flags = ("O_RDONLY", "O_BINARY", "O_CLOEXEC", "O_NOCTTY", "O_NONBLOCK")
    handle = os.open(path, sum(getattr(os, flag, 0) for flag in flags))
    with open(handle, "rb", buffering=0) as file:
        status = os.fstat(handle)  # of what was opened: the path may name something else by now
        _check_regular(status)
        if status.st_size > most:
            raise ContentsError(
                f"It has {status.st_size:,} bytes; such a file has {most:,} at most."
            )
        return file.read(status.st_size)


def _check_regular(status: os.stat_result) -> None:
    for is_kind, words in _KINDS.items():
        if is_kind(status.st_mode):
            raise ContentsError(f"It is {words}, not a regular file.")
    if not stat.S_ISREG(status.st_mode):
        raise ContentsError("It is not a regular file.")


_KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
}
