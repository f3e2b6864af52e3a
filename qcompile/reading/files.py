"""Reading regular files of limited size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from qcompile.limits import MAX_FILE_BYTES


class ContentsError(ValueError):
    """The contents of a file are invalid; the message says why."""


def read_file(path: str | Path, most: int = MAX_FILE_BYTES) -> bytes:
    """The contents of the regular file at `path`, at most `most` bytes.

    A pipe, device, socket or folder is refused before reading: it may never end.

    Raises:
        ContentsError: the path is not that of a regular file, or the file is too large.
        OSError: the file cannot be opened or read.
    """
    if "\0" in str(path):
        raise ContentsError("A path cannot contain a NUL character.")
    _check_regular(os.stat(path))  # opening a device may already move it
    flags = ("O_RDONLY", "O_BINARY", "O_CLOEXEC", "O_NOCTTY", "O_NONBLOCK")
    handle = os.open(path, sum(getattr(os, flag, 0) for flag in flags))
    with open(handle, "rb", buffering=0) as file:
        status = os.fstat(handle)  # of what was opened: the path may name something else by now
        _check_regular(status)
        if status.st_size > most:
            raise ContentsError(
                f"It has {status.st_size:,} bytes; the limit for such a file is {most:,}."
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
