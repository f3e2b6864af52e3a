"""The group of all commands; each is loaded when it is called."""

from __future__ import annotations

from importlib import import_module

import click

from qcompile.cli import COMMANDS
from qcompile.version import __version__


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
