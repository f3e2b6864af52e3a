"""A user's program on a GuardedSampler: entangled qubits, two registers, arrays of values.

It sends two calls before waiting for either, one call whose PUBs have different shots, and one
whose values depend on measurements.
"""

from __future__ import annotations

import json

import click
import numpy as np
from qiskit import ClassicalRegister, QuantumCircuit, QuantumRegister
from qiskit.circuit import Parameter

from qcompile.errors import QcompileError
from qcompile.live import GuardedSampler

JOURNAL = "runs/mine"


def entangled() -> QuantumCircuit:
    """Two qubits of fake_lima that agree."""
    circuit = QuantumCircuit(5, 2)
    circuit.sx(0)
    circuit.cx(0, 1)
    circuit.measure([0, 1], [0, 1])
    return circuit


def turned() -> QuantumCircuit:
    """One qubit rotated by an angle and one flipped, each in its own register."""
    angle = Parameter("angle")
    circuit = QuantumCircuit(
        QuantumRegister(5, "q"), ClassicalRegister(1, "left"), ClassicalRegister(2, "right")
    )
    circuit.sx(2)
    circuit.rz(angle, 2)
    circuit.sx(2)
    circuit.x(4)
    circuit.measure([2, 4], [0, 2])
    return circuit


def main(limit_s: float) -> None:
    """Run it, and print its results and their cost as JSON.

    Raises:
        SystemExit: 1 with a message, if it cannot continue now.
    """
    try:
        with GuardedSampler("fake_lima", limit_s, JOURNAL, pay_again=True) as sampler:
            click.echo(f"run {sampler.journal.id}", err=True)
            results = counts(sampler)
            costs = sampler.settle()
    except QcompileError as error:
        click.echo(f"Error: {error}", err=True)
        raise SystemExit(1) from None
    click.echo(json.dumps({"found": results} | costs))


def counts(sampler: GuardedSampler) -> list[list[dict[str, int]]]:
    """The counts of each PUB and register."""
    values = np.linspace(0.0, 3.0, 6).reshape(2, 3, 1)
    first = sampler.run([entangled()], shots=200)
    second = sampler.run([(turned(), values), entangled()], shots=100)
    results = [*second.result(), *first.result()]
    results += sampler.run([(turned(), [0.5], 30), (turned(), [1.5], 60)]).result()
    share = float(np.mean(results[0].data.left.to_bool_array()))
    results += sampler.run([(turned(), [share])], shots=40).result()
    return [[pub.data[name].get_int_counts() for name in pub.data] for pub in results]
