"""A command of qcompile in a fork of a process that has imported everything it needs."""

from __future__ import annotations

import importlib
import os
import pkgutil
import signal
import sys
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path

import chaos_program
import gymnasium
import torch  # noqa: F401

import qcompile
from qcompile.cli import main
from qcompile.live.database import Database

for module in pkgutil.walk_packages(qcompile.__path__, "qcompile."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
gymnasium.make("CartPole-v1").close()

PROGRAM = "program"
KILL_AT = "CHAOS_KILL_AT"
"""The journal write at which the process is killed: 2n means before the n-th, 2n + 1 after it."""


def call(words: tuple[str, ...], folder: str, environment: dict[str, str], number: int) -> None:
    """Run the command or program in a folder, with its streams in the files out and err.

    The names of these files, and of the file code with the exit code, end with this number.
    """
    os.environ.update(environment)
    os.chdir(folder)
    for stream, name in ((sys.stdout, "out"), (sys.stderr, "err")):
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        os.dup2(os.open(f"{name}{number}", flags, 0o600), stream.fileno())
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.argv = ["qcompile", *words]
    called: Callable[[], object] = main
    if words[0] == PROGRAM:
        called = partial(chaos_program.main, float(words[1]))
    if KILL_AT in environment:
        die_at(int(environment[KILL_AT]))
    code: object = 0
    try:
        called()
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    Path(f"code{number}").write_text(str(code))


def die_at(moment: int) -> None:
    """Make the process die silently just before or after a write to the journal."""
    do, left = Database.do, moment

    def once() -> None:
        nonlocal left
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1

    def dying(self: Database, statement: str, *values: object) -> None:
        once()
        do(self, statement, *values)
        once()

    Database.do = dying  # type: ignore[method-assign]
