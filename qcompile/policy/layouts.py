"""Common circuit layouts of policies.

In those of one-qubit circuits every circuit starts with h; a feature is encoded by ry(x) rz(x);
ry(theta) is trained. Source: arXiv 2203.14348, section "The model".
"""

from __future__ import annotations

from collections.abc import Callable

from qcompile.errors import PolicyError
from qcompile.ir import Circuit, Gate, Program


def parallel(features: int, copies: int) -> tuple[Program, list[int]]:
    """One circuit h ry(x) rz(x) ry(theta) per feature and copy, copy by copy.

    Returns the program and the feature of each input, like the other layouts.
    """
    count = features * copies
    circuits = [Circuit.parse(f"h ry(x{i}) rz(x{i}) ry(theta{i})") for i in range(count)]
    return Program.of(circuits, count, count), [*range(features)] * copies


def serial(features: int, layers: int) -> tuple[Program, list[int]]:
    """One circuit per feature, which encodes it `layers` times (re-uploading).

    Layer l of feature f uses the input and theta with index l * features + f.
    """
    circuits = []
    for feature in range(features):
        index = [layer * features + feature for layer in range(layers)]
        run = " ".join(f"ry(x{i}) rz(x{i}) ry(theta{i})" for i in index)
        circuits.append(Circuit.parse(f"h {run}"))
    count = features * layers
    return Program.of(circuits, count, count), [*range(features)] * layers


def single(features: int, copies: int) -> tuple[Program, list[int]]:
    """One circuit h rz(x0) ry(x1) rz(x2) rx(theta) per copy, for the last three features.

    The paper's device circuit (a), for CartPole: velocity, angle and angular velocity.

    Raises:
        PolicyError: there are fewer than three features.
    """
    if features < 3:
        raise PolicyError(f"The layout 'single' needs 3 features; there are {features}.")
    circuits = [
        Circuit.parse(f"h rz(x{3 * c}) ry(x{3 * c + 1}) rz(x{3 * c + 2}) rx(theta{c})")
        for c in range(copies)
    ]
    return Program.of(circuits, 3 * copies, copies), [*range(features - 3, features)] * copies


def ring(features: int, layers: int) -> tuple[Program, list[int]]:
    """One circuit with a qubit per feature, which encodes all of them `layers` times.

    A layer is ry(theta) rz(theta) on every qubit, a ring of cz, then ry(x) rz(x); ry(theta)
    rz(theta) close the circuit. Source: arXiv 2103.05577.
    """
    qubits = range(features)
    pairs = [(qubit, (qubit + 1) % features) for qubit in qubits]
    pairs = pairs if features > 2 else pairs[: features - 1]
    gates: list[Gate] = []
    for layer in range(layers + 1):
        for qubit in qubits:
            first = 2 * (layer * features + qubit)
            gates += [
                Gate.of(f"r{axis}", f"theta{first + part}", qubits=(qubit,))
                for part, axis in enumerate("yz")
            ]
        if layer == layers:
            break
        gates += [Gate("cz", None, pair) for pair in pairs]
        gates += [
            Gate.of(f"r{axis}", f"x{layer * features + qubit}", qubits=(qubit,))
            for qubit in qubits
            for axis in "yz"
        ]
    circuit = Circuit(tuple(gates), features)
    parameters = 2 * features * (layers + 1)
    return Program.of([circuit], features * layers, parameters), [*qubits] * layers


LAYOUTS: dict[str, Callable[[int, int], tuple[Program, list[int]]]] = {
    "parallel": parallel,
    "serial": serial,
    "single": single,
}
"""Layouts of one-qubit circuits by name.

They map (features, copies) to a program and the feature of each input.
"""
