"""The layers of a network: as plain values, and on the terminal."""

from __future__ import annotations

from typing import Any

import click

from qcompile.policy import Dense, Network
from qcompile.policy.decision import hold_values
from qcompile.report.tables import plural, print_hold, print_table


def network_values(network: Network) -> dict[str, Any]:
    """The plain values of `qcompile show --json` for a network.

    The inputs and outputs of a convolution are channels.
    """
    return {
        "policy": {
            "name": network.name,
            "environment": network.environment,
            "actions": network.actions,
            "parameters": network.parameter_count,
            **hold_values(network.hold),
        },
        "features": network.features,
        "normalised": network.mean is not None or network.std is not None,
        "layers": [
            {
                "layer": index,
                "type": "dense" if isinstance(layer, Dense) else "convolution",
                "inputs": layer.weights.shape[1],
                "outputs": layer.weights.shape[0],
                "activation": layer.activation,
                "parameters": layer.weights.size + layer.bias.size,
            }
            for index, layer in enumerate(network.layers)
        ],
    }


def print_network(values: dict[str, Any]) -> None:
    """Print the layers of `network_values`."""
    policy = values["policy"]
    normalised = ", normalised" * values["normalised"]
    click.echo(
        f"{policy['name']} for {policy['environment']}: a network of "
        f"{plural(len(values['layers']), 'layer')}, {plural(values['features'], 'feature')}"
        f"{normalised}, {policy['actions']} actions, {policy['parameters']} trained numbers"
    )
    print_hold(policy.get("hold", 1))
    columns = ["layer", "type", "inputs", "outputs", "activation", "parameters"]
    print_table(columns, [[layer[column] for column in columns] for layer in values["layers"]])
