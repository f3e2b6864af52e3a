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
    made = QuantumCircuit(5, 2)
    made.sx(0)
    made.cx(0, 1)
    made.measure([0, 1], [0, 1])
    return made


def turned() -> QuantumCircuit:
    """One qubit rotated by an angle and one flipped, each in its own register."""
    angle = Parameter("angle")
    made = QuantumCircuit(
        QuantumRegister(5, "q"), ClassicalRegister(1, "left"), ClassicalRegister(2, "right")
    )
    made.sx(2)
    made.rz(angle, 2)
    made.sx(2)
    made.x(4)
    made.measure([2, 4], [0, 2])
    return made


def main(limit_s: float) -> None:
    """Run it, and print its results and their cost as JSON.

    Raises:
        SystemExit: 1 with a message, if it cannot continue now.
    """
    try:
        with GuardedSampler("fake_lima", limit_s, JOURNAL, pay_again=True) as sampler:
            click.echo(f"run {sampler.journal.id}", err=True)
            found = counts(sampler)
            told = sampler.settle()
    except QcompileError as error:
        click.echo(f"Error: {error}", err=True)
        raise SystemExit(1) from None
    click.echo(json.dumps({"found": found} | told))


def counts(sampler: GuardedSampler) -> list[list[dict[str, int]]]:
    """The counts of each PUB and register."""
    values = np.linspace(0.0, 3.0, 6).reshape(2, 3, 1)
    first = sampler.run([entangled()], shots=200)
    second = sampler.run([(turned(), values), entangled()], shots=100)
    found = [*second.result(), *first.result()]
    found += sampler.run([(turned(), [0.5], 30), (turned(), [1.5], 60)]).result()
    share = float(np.mean(found[0].data.left.to_bool_array()))
    found += sampler.run([(turned(), [share])], shots=40).result()
    return [[pub.data[name].get_int_counts() for name in pub.data] for pub in found]
