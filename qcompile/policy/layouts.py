"""The circuits that policies are usually made of.

Every circuit starts with h; a feature is encoded by ry(x) rz(x); ry(theta) is trained.
Source: arXiv 2203.14348, section "The model".
"""

from __future__ import annotations

from collections.abc import Callable

from qcompile.errors import PolicyError
from qcompile.ir import Circuit, Program


def parallel(features: int, copies: int) -> tuple[Program, list[int]]:
    """One circuit for each feature and copy, h ry(x) rz(x) ry(theta), copy by copy.

    Returns the program and the feature of each of its inputs; so do the other layouts.
    """
    count = features * copies
    circuits = [Circuit.parse(f"h ry(x{i}) rz(x{i}) ry(theta{i})") for i in range(count)]
    return Program.of(circuits, count, count), [*range(features)] * copies


def serial(features: int, layers: int) -> tuple[Program, list[int]]:
    """One circuit for each feature, encoded `layers` times on the same qubit (re-uploading).

    Layer l of feature f has the input x and the theta with index l * features + f.
    """
    circuits = []
    for feature in range(features):
        index = [layer * features + feature for layer in range(layers)]
        run = " ".join(f"ry(x{i}) rz(x{i}) ry(theta{i})" for i in index)
        circuits.append(Circuit.parse(f"h {run}"))
    count = features * layers
    return Program.of(circuits, count, count), [*range(features)] * layers


def single(features: int, copies: int) -> tuple[Program, list[int]]:
    """One circuit that encodes the last three features, h rz(x0) ry(x1) rz(x2) rx(theta).

    The paper's device circuit (a), for CartPole: velocity, angle and angular velocity.

    Raises:
        PolicyError: there are fewer than three features.
    """
    if features < 3:
        raise PolicyError(f"The layout 'single' needs 3 features, found {features}.")
    circuits = [
        Circuit.parse(f"h rz(x{3 * c}) ry(x{3 * c + 1}) rz(x{3 * c + 2}) rx(theta{c})")
        for c in range(copies)
    ]
    return Program.of(circuits, 3 * copies, copies), [*range(features - 3, features)] * copies


LAYOUTS: dict[str, Callable[[int, int], tuple[Program, list[int]]]] = {
    "parallel": parallel,
    "serial": serial,
    "single": single,
}
"""Layouts by name: (features, copies or layers) to a program and the feature of each input."""
