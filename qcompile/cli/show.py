"""`qcompile show`: circuits before and after compilation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from qcompile.cli.options import backend_option, echo_json, json_option, level_option

if TYPE_CHECKING:
    from qcompile.policy.surrogate import Surrogate


@click.command("show")
@click.argument("subject", metavar="[POLICY|FILE.qasm]", default="lunarlander")
@backend_option()
@level_option
@click.option(
    "--surrogate",
    is_flag=True,
    help="Show instead the linear softmax policy that a policy's circuits compute, term by term.",
)
@json_option
@click.pass_context
def command(
    ctx: click.Context, subject: str, backend: str, level: int, surrogate: bool, as_json: bool
) -> None:
    """Show the circuits of a policy or an OpenQASM file, before and after compilation.

    A policy's theta is shown as a symbol; `run` and `export` put its numbers in. On a backend with
    qubits of its own the placement is shown too, and what it follows from.
    """
    if surrogate:
        _check_surrogate(ctx, subject)
        _show_surrogate(subject, as_json)
        return
    from qcompile.execution import load_backend
    from qcompile.passes import LEVELS, compile
    from qcompile.policy import load_policy
    from qcompile.report.placement import print_placement
    from qcompile.report.tables import print_table
    from qcompile.report.wires import executable_values, wire

    opened = load_backend(backend)
    device = opened.device
    if Path(subject).suffix == ".qasm":
        from qcompile.jobs.program_file import compile_source
        from qcompile.qasm.read import read_file

        policy, importance = None, None
        compiled = compile_source(read_file(subject), device, level, "3")
        executable, numbers = compiled.executable, compiled.circuits
    else:
        policy, numbers = load_policy(subject), None
        importance = policy.importance
        executable = compile(policy.program, device, level, importance)
    program = executable.source
    values = executable_values(executable, importance, numbers)
    if opened.calibration is not None:
        for row in values["left_out"]:
            if row["qubit"] not in opened.calibration.qubits:
                row["reason"] = "was not calibrated"
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
        ["circuit", "before", f"after, for {device.name}"],
        [[row["circuit"], row["source"], row["compiled"]] for row in values["circuits"]],
    )
    if values["definitions"]:
        click.echo("Angles computed when an observation is bound, such as")
        click.echo(f"  {values['definitions'][0]}")
    if not device.is_ideal:
        print_placement(values)


def _check_surrogate(ctx: click.Context, subject: str) -> None:
    """Refuse what --surrogate cannot be combined with."""
    if Path(subject).suffix == ".qasm":
        raise click.UsageError(
            f"--surrogate is for a policy; {subject} is a program, without encoder and head.", ctx
        )
    for name in ("backend", "level"):
        if ctx.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(
                f"--surrogate and --{name} exclude each other: nothing is compiled.", ctx
            )


def _show_surrogate(subject: str, as_json: bool) -> None:
    from qcompile.policy import load_policy
    from qcompile.policy.surrogate import Surrogate, merged_inputs
    from qcompile.report.tables import print_table

    policy = load_policy(subject)
    surrogate = Surrogate.of(policy)
    if as_json:
        echo_json(_surrogate_values(surrogate))
        return
    terms, circuits = len(surrogate.terms), len(policy.program)
    click.echo(
        f"{policy.name} for {policy.environment} is, without noise, a linear softmax policy on "
        f"{terms} fixed functions of\nthe observation: its {circuits} circuit"
        f"{'s compute' if circuits != 1 else ' computes'} exactly this.\n"
        f"surrogate: {policy.actions} x ({terms} weights + 1 bias) = {surrogate.parameter_count} "
        "numbers, and the input scales\n"
        f"policy: {policy.parameter_count} trained numbers, input scales included\n"
    )
    merged = merged_inputs(policy)
    for index, name in enumerate(policy.program.inputs):
        read, equal = policy.encoder.formula(index), str(merged[name])
        click.echo(f"  {name} = {read}" if equal == name else f"  {name} = {equal} = {read}")
    columns = ["term", *(f"action {action}" for action in range(policy.actions))]
    rows = [*zip(surrogate.terms, *surrogate.weights.tolist(), strict=True)]
    print_table(columns, [*rows, ("1 (bias)", *surrogate.bias.tolist())])


def _surrogate_values(surrogate: Surrogate) -> dict[str, Any]:
    """The plain values of `qcompile show --surrogate --json`."""
    return {
        "policy": surrogate.policy.name,
        "environment": surrogate.policy.environment,
        "inputs": _inputs(surrogate),
        "terms": [*surrogate.terms],
        "weights": surrogate.weights.tolist(),
        "bias": surrogate.bias.tolist(),
    }


def _inputs(surrogate: Surrogate) -> list[dict[str, Any]]:
    encoder = surrogate.policy.encoder
    rows = [
        {"input": name, "feature": feature, "scale": scale, "function": function}
        for name, feature, scale, function in zip(
            surrogate.policy.program.inputs,
            encoder.feature.tolist(),
            encoder.scale.tolist(),
            encoder.functions,
            strict=True,
        )
    ]
    more = {"gain": encoder.gain}
    for name, statistic in (("mean", encoder.mean), ("std", encoder.std)):
        more[name] = None if statistic is None else statistic[encoder.feature]
    for name, numbers in more.items():
        for row, number in zip(rows, [] if numbers is None else numbers.tolist(), strict=False):
            row[name] = number
    return rows
