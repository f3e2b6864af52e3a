"""Couplings as signed permutations of Pauli products, and of amplitudes."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.ir import Gate

_PAULIS = np.array([[[1, 0], [0, 1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])


class SignedPermutation(NamedTuple):
    """Entry i of the image of a vector is `sign[i]` times its entry `source[i]`.

    `is_touched` says whether the Pauli product i is more than I on the two qubits.
    """

    source: IntArray
    sign: FloatArray
    is_touched: NDArray[np.bool_]


def unitary(gate: str) -> NDArray[np.complex128]:
    """The matrix of a coupling, (4, 4), rows and columns 2 * control + target."""
    eye, x, y, z = _PAULIS
    if gate == "ecr":
        return np.asarray((np.kron(x, eye) - np.kron(y, x)) / np.sqrt(2))
    zero, one = (eye + z) / 2, (eye - z) / 2
    return np.asarray(np.kron(zero, eye) + np.kron(one, x if gate == "cx" else z))


@cache
def on_pair(gate: str) -> SignedPermutation:
    """The coupling on the Pauli products P_control P_target, number 4 * control + target.

    All couplings are Clifford gates, so U P U+ is a Pauli product up to sign.
    """
    pairs = [np.kron(a, b) for a, b in product(_PAULIS, repeat=2)]
    after = [unitary(gate) @ pair @ unitary(gate).conj().T for pair in pairs]
    overlap = np.array([[np.trace(p @ q).real / 4 for q in after] for p in pairs])
    source = np.abs(overlap).argmax(axis=1)
    return SignedPermutation(source, np.round(overlap[np.arange(16), source]), np.arange(16) > 0)


@cache
def on_pauli_vector(gate: str, qubits: tuple[int, int], width: int) -> SignedPermutation:
    """The coupling on the Pauli vector of `width` qubits, the first one's index slowest."""
    numbers = np.arange(4**width).reshape((4,) * width)
    pair = on_pair(gate)
    moved = np.moveaxis(numbers, qubits, (0, 1)).reshape(16, -1)

    def back(array: NDArray[Any]) -> NDArray[Any]:
        spread = np.broadcast_to(array.reshape(16, -1), moved.shape)
        return np.moveaxis(spread.reshape((4,) * width), (0, 1), qubits).ravel()

    return SignedPermutation(*map(back, (moved[pair.source], pair.sign, pair.is_touched)))


def on_amplitudes(gates: Iterable[Gate], width: int) -> tuple[IntArray, IntArray]:
    """cx and cz one after another: amplitude i becomes `sign[i]` times amplitude `source[i]`.

    The bit of the first of `width` qubits is the highest.
    """
    number = np.arange(2**width)
    source, sign = number, np.ones_like(number)
    for gate in gates:
        control, target = (number >> (width - 1 - qubit) & 1 for qubit in gate.qubits)
        if gate.name == "cx":
            read = number ^ control << (width - 1 - gate.qubits[1])
            source, sign = source[read], sign[read]
        else:
            sign = sign * (1 - 2 * (control & target))
    return source, sign
