"""Writing files and folders whole or not at all; for files, even if the machine crashes."""

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

from qcompile.caller import option
from qcompile.errors import OptionError, OutputError, QcompileError

_SAFE = re.compile(r"\w[\w.-]{0,79}", re.ASCII)


def file_name(name: str) -> str:
    """`name` if it is safe in a file name; otherwise its safe characters and 8 hash digits."""
    if _SAFE.fullmatch(name):
        return name
    digits = hashlib.sha256(name.encode()).hexdigest()[:8]
    rest = re.sub(r"[^A-Za-z0-9_.-]+", "-", name).lstrip(".-")  # a leading dot would hide the file
    return f"{rest[:60]}-{digits}" if rest else digits


def checked_path(path: object, name: str = "path") -> Path:
    """The path of the file that an argument, called `name`, names.

    Raises:
        OptionError: it is neither a name nor a path.
    """
    if isinstance(path, str | os.PathLike) and isinstance(word := os.fspath(path), str):
        if "\0" not in word:
            return Path(word)
        raise OptionError(
            f"{name} cannot be {word!a:.60}.", "The name of a file has no null character."
        )
    what = "None" if path is None else f"of type {type(path).__name__}"
    raise OptionError(f"{name} cannot be {what}.", "It must be a name or a path.")


def write_file(path: Path, contents: bytes) -> None:
    """Write `contents` to `path`, which is replaced in one step or left unchanged.

    Links are followed. A special file, such as /dev/stdout, is written to directly.

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
        raise  # the reader closed the pipe
    except OSError as error:
        raise _cannot_write(path, error) from error


def sync(folder: Path) -> None:
    """Flush the entries of a folder to disk, on systems that support it."""
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
    """The path with links resolved; unlike Path.resolve, a cycle of links raises nothing."""
    return Path(os.path.realpath(path))


def _is_special(path: Path) -> bool:
    """Whether the path exists and is neither a file nor a folder, such as a device.

    Called before links are resolved: in a pipeline /dev/stdout does not link to a path.
    """
    return path.exists() and not path.is_file() and not path.is_dir()


def _mode(path: Path) -> int:
    """The permissions of the file to be replaced, or those of a new file."""
    if path.exists():
        return path.stat().st_mode & 0o777
    return 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)  # reading the mask requires setting it
    os.umask(mask)
    return mask


def check_writable(path: Path) -> None:
    """Check, before long work starts, that `write_file` can write to `path`.

    Raises:
        OutputError: it cannot; nothing was created.
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
    """A temporary folder that becomes `path` when the block ends without an error.

    Raises:
        OutputError: `path` exists and is not an empty folder, or cannot be created.
    """
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise OutputError(
            f"{path} already exists.", f"Remove it, or choose another with {option('out')}."
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
