"""The group of all commands; each is loaded when it is used."""

from __future__ import annotations

from importlib import import_module

import click

from qcompile.cli import COMMANDS
from qcompile.version import __version__

_HELP = {"help_option_names": ["-h", "--help"]}


class _LazyGroup(click.Group):
    """Loads the module of a command when the command is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"qcompile.cli.{cmd_name}").command
        # click keeps the names of the first context that asks a command for its help
        command.context_settings.update(_HELP)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_LazyGroup, context_settings=_HELP)
@click.version_option(__version__, prog_name="qcompile")
@click.option("--traceback", is_flag=True, help="Show the Python traceback of an error.")
def cli(traceback: bool) -> None:
    """Compile policies made of one-qubit variational circuits to a device's native gates, and
    play them on its noise model or on IBM hardware.

    \b
    qcompile run --backend ibm_lima        play the shipped LunarLander policy on a noise model
    qcompile show lunarlander              show its circuits before and after compilation
    qcompile export lunarlander --out job  write the compiled circuits as OpenQASM
    """
