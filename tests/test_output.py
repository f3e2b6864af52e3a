"""Files appear whole or not at all, at the right path and with the right mode."""

from __future__ import annotations

import errno
import os
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from qcompile.errors import OutputError
from qcompile.output import check_writable, new_folder, resolved, write_file


@contextmanager
def umask(mask: int) -> Iterator[None]:
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_followed(tmp_path: Path, there: bool) -> None:
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "file", tmp_path / "link"
    if there:
        target.write_bytes(b"old")
    link.symlink_to(Path("real") / "file")
    check_writable(link)
    write_file(link, b"new")
    assert link.is_symlink()
    assert not target.is_symlink()
    assert target.read_bytes() == b"new"
    assert names(tmp_path) == ["link", "real"]
    assert names(tmp_path / "real") == ["file"]


@pytest.mark.parametrize("old", [0o600, 0o640, 0o755])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, old: int) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    path.chmod(old)
    with umask(0o022):
        write_file(path, b"new")
    assert (path.read_bytes(), mode(path)) == (b"new", old)


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002, 0])
def test_new_files_have_the_users_mode(tmp_path: Path, mask: int) -> None:
    with umask(mask):
        write_file(tmp_path / "file", b"new")
        with new_folder(tmp_path / "folder"):
            pass
        assert os.umask(mask) == mask, "the mask of the process was changed"
    assert mode(tmp_path / "file") == 0o666 & ~mask
    assert mode(tmp_path / "folder") == 0o777 & ~mask


def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    check_writable(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write_file(pipe, b"through")
    reader.join(timeout=10)
    assert read == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert names(tmp_path) == ["pipe"]


def test_the_null_device_stays_one(tmp_path: Path) -> None:
    link = tmp_path / "null"
    link.symlink_to(os.devnull)
    for path in (Path(os.devnull), link):
        check_writable(path)
        write_file(path, b"gone")
        assert stat.S_ISCHR(path.stat().st_mode)
    assert names(tmp_path) == ["null"]


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    for act in (check_writable, lambda path: write_file(path, b"new")):
        with pytest.raises(OutputError, match="Cannot write"):
            act(tmp_path)
    assert names(tmp_path) == []


def test_a_link_to_a_pipe_is_written_to(tmp_path: Path) -> None:
    """/dev/stdout of a pipeline, which does not link to a path."""
    read, write = os.pipe()
    link = tmp_path / "stdout"
    link.symlink_to(f"/proc/self/fd/{write}")
    check_writable(link)
    write_file(link, b"new")
    os.close(write)
    with os.fdopen(read, "rb") as reader:
        assert reader.read() == b"new"
    assert link.is_symlink()


def test_a_reader_who_has_had_enough_is_no_error_of_the_file() -> None:
    read, write = os.pipe()
    os.close(read)
    with pytest.raises(BrokenPipeError):
        write_file(Path(f"/proc/self/fd/{write}"), b"new")
    os.close(write)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_the_error_that_stops_filling_a_folder_is_named(tmp_path: Path, number: int) -> None:
    folder = tmp_path / "job"

    def fill() -> None:
        with new_folder(folder):
            raise OSError(number, os.strerror(number))

    with pytest.raises(OutputError, match=f"Cannot write {folder}.\n  {os.strerror(number)}"):
        fill()
    assert list(tmp_path.iterdir()) == []


def test_links_that_lead_to_each_other_raise_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    resolved(tmp_path / "a")
    try:
        check_writable(tmp_path / "a")
        write_file(tmp_path / "a", b"x")
    except OutputError:
        return
    assert (tmp_path / "a").read_bytes() == b"x"


def test_a_power_cut_leaves_a_file_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is inside is on the disk before it has its name, and the name before it is used."""
    real, synced = os.fsync, []

    def fsync(handle: int) -> None:
        opened = os.fstat(handle)
        path = next(
            p for p in (tmp_path, *tmp_path.rglob("*")) if os.path.samestat(opened, p.stat())
        )
        text = "" if path.is_dir() else path.read_text()
        synced.append((path.name.lstrip(".").partition(".")[0], text, names(tmp_path)))
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    write_file(tmp_path / "file", b"new")
    (inside, text, before), (folder, _, after) = synced
    assert (inside, text, folder) == ("file", "new", tmp_path.name)
    assert ("file" in before, "file" in after) == (False, True)
