"""The command line: one file per command, loaded when it is called."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from importlib import import_module
from io import TextIOWrapper
from types import TracebackType

import click

from qcompile import __version__
from qcompile.errors import QcompileError
from qcompile.terminal import plain, plain_output

COMMANDS = {
    "run": "Play episodes with a policy on a backend.",
    "evaluate": "Play a grid of policies, backends, shots and mitigations.",
    "calibrate": "Measure the readout and the response of a device's qubits.",
    "plan": "Say what a policy costs on a machine, in each way to run it.",
    "validate": "Test a calibration's twin against fresh counts.",
    "runs": "List, show and export live runs.",
    "resume": "Go on with a live run.",
    "show": "Show circuits before and after compilation.",
    "export": "Write a policy's circuits as an OpenQASM job.",
    "compile": "Compile an OpenQASM 2 or 3 file.",
    "train": "Train a policy with PPO.",
    "study": "Repeat the paper's training study.",
    "backends": "List, show and add devices.",
}
"""Name and first help line of every command, so that --help loads none of them."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What a device says that standard output cannot be written to any more."""


class _LazyGroup(click.Group):
    """Loads the module of a command when the command is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"qcompile.cli.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="qcompile")
@click.option("--traceback", is_flag=True, help="Show where an error comes from.")
def cli(traceback: bool) -> None:
    """Compile policies of single-qubit variational circuits to a device's own gates and play
    them on its noise model.

    \b
    qcompile run --backend ibm_lima        land the shipped LunarLander policy on ibm_lima's noise
    qcompile show lunarlander              its circuits, before and after compilation
    qcompile export lunarlander --out job  the circuits as OpenQASM
    """


def main() -> None:
    """Run the command line; exit 0 on success, 1 on an explained failure, 2 on wrong usage.

    What is printed is plain text (`qcompile.terminal`), whoever wrote it, and a traceback holds no
    token.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without the bars and wires of tables
    sys.excepthook = _show_traceback
    with plain_output():
        _run()


def _run() -> None:
    if "--traceback" in sys.argv[1:]:
        cli()
    try:
        cli()
    except QcompileError as error:
        _fail(str(error))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except ImportError as error:
        if (error.name or "").partition(".")[0] == "qcompile":
            raise
        _fail(
            f"A package that qcompile needs cannot be loaded: {error}.\n"
            "  Install it with: pip install qcompile"
        )
    except OSError as error:
        if error.errno not in _FULL:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _fail(f"The answer cannot be written: {os.strerror(error.errno).lower()}.")


def _fail(message: str) -> None:
    click.echo(f"Error: {_without_secrets(message)}", err=True)
    sys.exit(1)


def _show_traceback(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """What the interpreter shows of an error that nobody caught, plain and without tokens."""
    words = "".join(traceback.format_exception(kind, error, trace))
    click.echo(plain(_without_secrets(words)), nl=False, err=True)


def _without_secrets(words: str) -> str:
    from qcompile.live.words import without_secrets

    return without_secrets(words)
