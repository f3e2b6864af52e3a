"""Files are opened in one module, which reads only regular files of limited size."""

from __future__ import annotations

import ast
import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

import qcompile
from qcompile.reading import ContentsError, read_file

PACKAGE = Path(qcompile.__file__).parent


def as_pipe(path: Path) -> None:
    os.mkfifo(path)


def as_folder(path: Path) -> None:
    path.mkdir()


def as_socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # the name of a socket has 108 letters at most
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(here)


def as_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [as_pipe, as_folder, as_socket, as_device])
def test_a_file_that_may_never_end_is_not_read(
    make: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / "x"
    make(path)
    words = rf"It is a {make.__name__.removeprefix('as_')}, not a regular file"
    with pytest.raises(ContentsError, match=words):
        read_file(path)


def test_a_file_is_read_whole_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(bytes(1000))
    assert read_file(path, 1000) == bytes(1000)
    (tmp_path / "link").symlink_to(path)
    assert read_file(tmp_path / "link", 1000) == bytes(1000)
    with pytest.raises(
        ContentsError, match=r"It has 1,000 bytes; the limit for such a file is 999"
    ):
        read_file(path, 999)


def test_a_file_of_terabytes_is_not_begun(tmp_path: Path) -> None:
    path = tmp_path / "x"
    with path.open("wb") as file:
        file.truncate(2**42)
    with pytest.raises(ContentsError, match="bytes; the limit"):
        read_file(path)


def test_names_that_lead_nowhere(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for path in (tmp_path / "a", tmp_path / "none", tmp_path / ("n" * 5000)):
        with pytest.raises(OSError, match=r"\[Errno"):
            read_file(path)
    with pytest.raises(ContentsError, match="NUL"):
        read_file("a\0b")


_READERS = {"open", "read_text", "read_bytes", "load", "loadtxt", "genfromtxt", "fromfile"}
_READERS |= {"memmap", "fdopen", "ZipFile", "Unpickler"}
_OTHERS = {
    ("cli/__init__.py", "open"): "os.devnull, written to",
    ("output.py", "open"): "a folder, to have its names on the disk",
    ("output.py", "fdopen"): "written to",
    ("rl/training_log.py", "open"): "written to",
    ("report/film.py", "read_bytes"): "the film it has just made",
}


def _files(tree: ast.Module) -> set[str]:
    """The functions that a module calls and that read files: Backend.open reads none."""
    found = set()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name, owner = "", ""
        if isinstance(node.func, ast.Name):
            name = node.func.id
        elif isinstance(node.func, ast.Attribute):
            name, owner = node.func.attr, ast.unparse(node.func.value)
        if name == "open" and owner in (
            "self",
            "backend",
            "self._backend",
            "load_backend(backend)",
        ):
            continue
        if name == "load" and owner not in ("np", "numpy", "json", "torch", "pickle", "tomllib"):
            continue
        found |= {name} & _READERS
    return found


def test_no_other_module_opens_files() -> None:
    others = {
        (str(path.relative_to(PACKAGE)), name)
        for path in PACKAGE.rglob("*.py")
        if path.relative_to(PACKAGE).parts[0] != "reading"
        for name in _files(ast.parse(path.read_text()))
    }
    assert others == set(_OTHERS)


def test_the_search_for_readers_finds_them() -> None:
    for line in ("open(p)", "Path(p).read_text()", "np.load(p)", "json.load(f)", "torch.load(p)"):
        assert _files(ast.parse(line)), line
    assert not _files(ast.parse("backend.open(seed)"))
