"""A command of qcompile in a fork of a process that has imported everything it needs."""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
import traceback
from pathlib import Path

import gymnasium
import torch  # noqa: F401

import qcompile
from qcompile.cli import main

for module in pkgutil.walk_packages(qcompile.__path__, "qcompile."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
gymnasium.make("CartPole-v1").close()


def call(words: tuple[str, ...], folder: str, environment: dict[str, str], number: int) -> None:
    """Run the command in a folder, its streams in the files out and err with this number.

    Its exit code comes into the file code with that number.
    """
    os.environ.update(environment)
    os.chdir(folder)
    for stream, name in ((sys.stdout, "out"), (sys.stderr, "err")):
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        os.dup2(os.open(f"{name}{number}", flags, 0o600), stream.fileno())
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.argv = ["qcompile", *words]
    code: object = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    Path(f"code{number}").write_text(str(code))
