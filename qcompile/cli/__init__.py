"""The command line: one file per command, loaded when the command is used."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from io import TextIOWrapper
from types import TracebackType
from typing import NoReturn

from qcompile.caller import command_line
from qcompile.cli.interrupts import after_imports
from qcompile.errors import OptionError, QcompileError
from qcompile.terminal import plain, plain_output

COMMANDS = {
    "run": "Play episodes with a policy on a backend.",
    "evaluate": "Compare policies, backends, shots and mitigations in a grid.",
    "calibrate": "Measure the readout and the response of a device's qubits.",
    "plan": "Estimate what a policy costs on a machine, before anything is sent.",
    "validate": "Test a calibration against fresh counts.",
    "runs": "List, show and export live runs.",
    "resume": "Resume a live run where it stopped.",
    "show": "Show circuits before and after compilation.",
    "export": "Write a policy's circuits as an OpenQASM job.",
    "compile": "Compile an OpenQASM 2 or 3 file.",
    "train": "Train a policy with PPO.",
    "study": "Train many policies with several seeds, and write up the results.",
    "backends": "List, show and add devices.",
}
"""Name and summary of every command, so that --help need not load them."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a device that standard output can no longer be written to."""


def main() -> None:
    """Run the command line; exit 0 on success, 1 on an explained failure, 2 on wrong usage.

    Everything printed is plain text (`qcompile.terminal`), wherever it comes from, and tokens are
    removed from tracebacks.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # some terminals cannot show bars and wires
    if not os.environ.get("COLUMNS", "1").strip("0"):
        del os.environ["COLUMNS"]  # no terminal is 0 wide
    sys.excepthook = _show_traceback
    with command_line(), plain_output(), after_imports():
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
    """Exit with an explanation of the error, or raise it if it is a defect of qcompile."""
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
        _fail(f"Cannot write the output: {os.strerror(error.errno).lower()}.")
    raise error


def _drop_output() -> None:
    """Discard the rest of the output, which Python would otherwise try to write at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str, code: int = 1) -> NoReturn:
    import click

    click.echo(f"Error: {_without_secrets(message)}", err=True)
    sys.exit(code)


def _show_traceback(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print the traceback of an uncaught error as plain text, without tokens."""
    import click

    words = "".join(traceback.format_exception(kind, error, trace))
    click.echo(plain(_without_secrets(words)), nl=False, err=True)


def _without_secrets(words: str) -> str:
    from qcompile.live.client_errors import without_secrets

    return without_secrets(words)
