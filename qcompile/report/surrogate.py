"""The classical surrogate of a policy: as plain values, and on the terminal."""

from __future__ import annotations

from typing import Any

import click

from qcompile.policy.decision import hold_values
from qcompile.policy.surrogate import Surrogate, merged_inputs
from qcompile.report.tables import print_hold, print_table


def surrogate_values(surrogate: Surrogate) -> dict[str, Any]:
    """The plain values of `qcompile show --surrogate --json`."""
    return {
        "policy": surrogate.policy.name,
        "environment": surrogate.policy.environment,
        **hold_values(surrogate.policy.hold),
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
    columns = {"gain": encoder.gain}
    for name, statistic in (("mean", encoder.mean), ("std", encoder.std)):
        columns[name] = None if statistic is None else statistic[encoder.feature]
    for name, numbers in columns.items():
        for row, number in zip(rows, [] if numbers is None else numbers.tolist(), strict=False):
            row[name] = number
    return rows


def print_surrogate(surrogate: Surrogate) -> None:
    """Print the functions of a policy's circuits, and their weights in each action."""
    policy = surrogate.policy
    terms, circuits = len(surrogate.terms), len(policy.program)
    click.echo(
        f"{policy.name} for {policy.environment} is, without noise, a linear softmax policy on "
        f"{terms} fixed functions of\nthe observation: its {circuits} circuit"
        f"{'s compute' if circuits != 1 else ' computes'} exactly this.\n"
        f"surrogate: {policy.actions} x ({terms} weights + 1 bias) = {surrogate.parameter_count} "
        "numbers, and the input scales\n"
        f"policy: {policy.parameter_count} trained numbers, input scales included"
    )
    print_hold(policy.hold)
    click.echo()
    merged = merged_inputs(policy)
    for index, name in enumerate(policy.program.inputs):
        read, equal = policy.encoder.formula(index), str(merged[name])
        click.echo(f"  {name} = {read}" if equal == name else f"  {name} = {equal} = {read}")
    columns = ["term", *(f"action {action}" for action in range(policy.actions))]
    rows = [*zip(surrogate.terms, *surrogate.weights.tolist(), strict=True)]
    print_table(columns, [*rows, ("1 (bias)", *surrogate.bias.tolist())])
