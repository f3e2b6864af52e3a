"""Workers end with the process they work for, even where it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from qcompile.sweep.workers import deaf_children

SCRIPT = """
import os, time
from collections import namedtuple
from pathlib import Path
from qcompile.sweep.engine import run_all

Cell = namedtuple("Cell", "name folder")

def run(cell):
    (Path(cell.folder) / str(os.getpid())).touch()
    while True:
        sum(range(100_000))  # busy, as a training is

run_all([Cell(n, {folder!r}) for n in "ab"], run, print, workers=2)
"""


def alive(pid: int) -> bool:
    """Whether the process is there, and not only waiting for its parent to look."""
    try:
        state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True).stdout
    except FileNotFoundError:
        pytest.skip("there is no ps")
    return bool(state) and not state.startswith(b"Z")


def test_workers_of_a_killed_study_end(tmp_path: Path) -> None:
    script = SCRIPT.format(folder=str(tmp_path))
    parent = subprocess.Popen([sys.executable, "-W", "ignore", "-c", script])
    try:
        end = time.monotonic() + 60
        while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < end:
            time.sleep(0.05)
        workers = [int(path.name) for path in tmp_path.iterdir()]
        assert len(workers) == 2
        assert parent.pid not in workers
        parent.kill()
        parent.wait()
        end = time.monotonic() + 30
        while any(map(alive, workers)) and time.monotonic() < end:
            time.sleep(0.05)
        assert not any(map(alive, workers))
    finally:
        parent.kill()
        for path in tmp_path.iterdir():
            if alive(int(path.name)):
                os.kill(int(path.name), signal.SIGKILL)


def test_ctrl_c_is_the_parent_s_alone() -> None:
    child = "import os, signal, sys; os.kill(os.getpid(), signal.SIGINT); sys.exit(7)"
    words = [sys.executable, "-c", child]
    with deaf_children():
        assert subprocess.run(words, check=False).returncode == 7
    assert subprocess.run(words, check=False, stderr=subprocess.DEVNULL).returncode != 7
