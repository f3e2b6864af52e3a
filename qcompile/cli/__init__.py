"""The command line: one file per command, loaded when it is called."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from io import TextIOWrapper
from types import TracebackType
from typing import NoReturn

from qcompile.cli.interrupts import after_imports
from qcompile.errors import OptionError, QcompileError
from qcompile.terminal import plain, plain_output

COMMANDS = {
    "run": "Play episodes with a policy on a backend.",
    "evaluate": "Play a grid of policies, backends, shots and mitigations.",
    "calibrate": "Measure the readout and the response of a device's qubits.",
    "plan": "Say what a policy costs on a machine, in each way to run it.",
    "validate": "Test a calibration's twin against fresh counts.",
    "runs": "List, show and export live runs.",
    "resume": "Resume a live run.",
    "show": "Show circuits before and after compilation.",
    "export": "Write a policy's circuits as an OpenQASM job.",
    "compile": "Compile an OpenQASM 2 or 3 file.",
    "train": "Train a policy with PPO.",
    "study": "Train the rows of a study: the paper's, or your own.",
    "backends": "List, show and add devices.",
}
"""Name and first help line of every command, so that --help loads none of them."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What a device says that standard output cannot be written to any more."""


def main() -> None:
    """Run the command line; exit 0 on success, 1 on an explained failure, 2 on wrong usage.

    What is printed is plain text (`qcompile.terminal`), whoever wrote it, and a traceback holds no
    token.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without the bars and wires of tables
    if not os.environ.get("COLUMNS", "1").strip("0"):
        del os.environ["COLUMNS"]  # no terminal is 0 wide
    sys.excepthook = _show_traceback
    with plain_output(), after_imports():
        if "--traceback" in sys.argv[1:]:
            _run()
        try:
            _run()
        except Exception as error:
            _explain(error)


def _run() -> None:
    try:
        from qcompile.cli.group import cli
    except KeyboardInterrupt:
        _fail("Interrupted.")
    cli()


def _explain(error: Exception) -> NoReturn:
    """End with words on an error, or raise it where it is a defect of ours."""
    if isinstance(error, OptionError):
        _fail(str(error), 2)
    if isinstance(error, QcompileError):
        _fail(str(error))
    if isinstance(error, BrokenPipeError):
        _drop_output()
        sys.exit(1)
    if isinstance(error, ImportError) and not (error.name or "").startswith("qcompile"):
        _fail(
            f"A package that qcompile needs cannot be loaded: {error}.\n"
            "  Install it with: pip install qcompile"
        )
    if isinstance(error, OSError) and error.errno in _FULL:
        _drop_output()
        _fail(f"The answer cannot be written: {os.strerror(error.errno).lower()}.")
    raise error


def _drop_output() -> None:
    """Have what is left of the output go nowhere: it cannot be written when Python ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str, code: int = 1) -> NoReturn:
    import click

    click.echo(f"Error: {_without_secrets(message)}", err=True)
    sys.exit(code)


def _show_traceback(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """What the interpreter shows of an error that nobody caught, plain and without tokens."""
    import click

    words = "".join(traceback.format_exception(kind, error, trace))
    click.echo(plain(_without_secrets(words)), nl=False, err=True)


def _without_secrets(words: str) -> str:
    from qcompile.live.client_errors import without_secrets

    return without_secrets(words)
