"""Files and folders that appear whole or not at all: files even where the machine crashes."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from qcompile.errors import OutputError, QcompileError

_SAFE = re.compile(r"\w[\w.-]{0,79}", re.ASCII)


def file_name(name: str) -> str:
    """`name` if it is safe as part of a file name; else its safe characters and 8 hash digits."""
    if _SAFE.fullmatch(name):
        return name
    digits = hashlib.sha256(name.encode()).hexdigest()[:8]
    rest = re.sub(r"[^A-Za-z0-9_.-]+", "-", name).lstrip(".-")  # else the file would be hidden
    return f"{rest[:60]}-{digits}" if rest else digits


def write_file(path: Path, contents: bytes) -> None:
    """Write `contents` to `path`, which is replaced in one step or left as it was.

    A link is followed; what is no regular file, such as /dev/stdout, is written to directly.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        if _is_special(path):
            path.write_bytes(contents)
            return
        target = resolved(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(contents)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, _mode(target))
            os.replace(temporary, target)
            sync(target.parent)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except BrokenPipeError:
        raise  # the reader has had enough
    except OSError as error:
        raise _cannot_write(path, error) from error


def sync(folder: Path) -> None:
    """Have the names in a folder on the disk, where the system has a way to ask for that."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems
            raise
    finally:
        os.close(handle)


def resolved(path: Path) -> Path:
    """The path without links; unlike Path.resolve, links that lead to each other raise nothing."""
    return Path(os.path.realpath(path))


def _is_special(path: Path) -> bool:
    """Whether there is something that is neither a file nor a folder, such as a device.

    Asked before links are resolved: /dev/stdout links to no path where it is a pipe.
    """
    return path.exists() and not path.is_file() and not path.is_dir()


def _mode(path: Path) -> int:
    """The permissions of the file that is replaced, or those a new file would get."""
    if path.exists():
        return path.stat().st_mode & 0o777
    return 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)  # it cannot be read without being set
    os.umask(mask)
    return mask


def check_writable(path: Path) -> None:
    """Raise, before anything long is run, where `write_file` cannot write to `path`.

    Raises:
        OutputError: it cannot; nothing has been made.
    """
    try:
        if _is_special(path):
            return
        target = resolved(path)
        folder = next(p for p in target.parents if os.path.lexists(p))
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "It is a folder")
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".{path.name}.")
        os.close(handle)
        os.unlink(temporary)
    except OSError as error:
        raise _cannot_write(path, error) from error


def _cannot_write(path: Path, error: OSError) -> OutputError:
    above = next((p for p in path.parents if os.path.lexists(p) and not os.path.isdir(p)), None)
    why = f"{above} is not a folder." if above else f"{error.strerror or error}."
    return OutputError(f"Cannot write {path}.", why, "Choose another path.")


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A folder to fill, which becomes `path` when the block ends without an error.

    Raises:
        OutputError: `path` is there already and is not an empty folder, or cannot be made.
    """
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise OutputError(
            f"The output folder {path} is in use.", "Remove it, or choose another with --out."
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}."))
    except OSError as error:
        raise _cannot_write(path, error) from error
    try:
        yield temporary
        temporary.chmod(0o777 & ~_umask())
        os.replace(temporary, path)
    except QcompileError:
        raise
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
