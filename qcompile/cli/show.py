"""`qcompile show`: circuits before and after compilation."""

from __future__ import annotations

from pathlib import Path

import click

from qcompile.cli.options import backend_option, echo_json, json_option, level_option


@click.command("show")
@click.argument("subject", metavar="[POLICY|FILE.qasm]", default="lunarlander")
@backend_option()
@level_option
@json_option
def command(subject: str, backend: str, level: int, as_json: bool) -> None:
    """Show the circuits of a policy or an OpenQASM file, before and after compilation.

    A policy's theta is shown as a symbol; `run` and `export` put its numbers in.
    """
    from qcompile.device import load_device
    from qcompile.passes import LEVELS, compile
    from qcompile.policy import load_policy
    from qcompile.report.tables import print_table
    from qcompile.report.wires import executable_values, wire

    device = load_device(backend)
    if Path(subject).suffix == ".qasm":
        from qcompile.jobs.program_file import compile_source
        from qcompile.qasm.read import read_file

        policy, executable = None, compile_source(read_file(subject), device, level, "3").executable
    else:
        policy = load_policy(subject)
        executable = compile(policy.program, device, level)
    program = executable.source
    values = executable_values(executable)
    if policy is not None:
        values["policy"] = {
            "name": policy.name,
            "environment": policy.environment,
            "actions": policy.actions,
            "parameters": policy.parameter_count,
        }
    if as_json:
        echo_json(values)
        return
    if policy is not None:
        click.echo(
            f"{policy.name} for {policy.environment}: {len(program)} circuits, "
            f"{policy.actions} actions, {policy.parameter_count} trained numbers"
        )
    click.echo(f"level {level}: {LEVELS[level]}")
    if len(program):
        click.echo(f"  before  {wire(program.circuits[0])}")
        click.echo(f"  after   {wire(executable.native.circuits[0])}")
    print_table(
        ["circuit", "before", f"after, for {device.name}", "qubit", "round"],
        [
            [row["circuit"], row["source"], row["compiled"], row["qubit"], row["round"]]
            for row in values["circuits"]
        ],
    )
    if values["definitions"]:
        click.echo("Angles computed when an observation is bound, such as")
        click.echo(f"  {values['definitions'][0]}")
