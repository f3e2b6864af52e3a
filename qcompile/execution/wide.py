"""Programs with circuits of several qubits on a noise model: parities, and counts of them."""

from __future__ import annotations

from functools import cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray, IntArray
from qcompile.errors import CircuitError
from qcompile.execution.prepared import Binomial, ExactPrepared, largest_shots
from qcompile.ir import Circuit, Program
from qcompile.limits import MAX_IDEAL_QUBITS, MAX_NOISY_QUBITS
from qcompile.passes import Executable
from qcompile.states.ideal import IdealBlocks
from qcompile.states.pauli import NoisyBlocks
from qcompile.streams.draws import RowDraws


class _Observables(NamedTuple):
    """Observables on a circuit: their numbers in the program, and among the products of Z."""

    numbers: IntArray
    products: IntArray


class _Group(NamedTuple):
    """Circuits of one shape, evaluated together: their slots are (circuits, slots of each)."""

    circuits: list[int]
    slots: IntArray
    blocks: NoisyBlocks | IdealBlocks


class PreparedWide(ExactPrepared):
    """An executable with circuits of several qubits, with the noise of its qubits and couplings.

    Raises:
        CircuitError: a circuit has more qubits than can be computed.
    """

    def __init__(self, executable: Executable, rng: np.random.Generator):
        super().__init__(executable, rng)
        source, native = executable.source, executable.native
        _check_widths(native, executable.device.is_ideal)
        self._widths = source.widths
        self._observables = [_on_circuit(source, index) for index in range(len(source))]
        shapes: dict[object, list[int]] = {}
        for index, circuit in enumerate(native.circuits):
            key = source.widths[index], circuit.width, _shape(circuit)
            shapes.setdefault(key, []).append(index)
        self._groups = [_group(executable, circuits) for circuits in shapes.values()]

    def expectation(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        result = np.empty((len(x), len(self.executable.source.measured)))
        for index, parities in self._parities(x, theta):
            numbers, products = self._observables[index]
            result[:, numbers] = parities[:, products]
        return result

    def p_one(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """P(odd) of each observable, (B, observables), in [0, 1] up to rounding."""
        return (1.0 - self.expectation(x, theta)) / 2

    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        """The number of shots with odd parity of each observable, (B, observables)."""
        largest_shots(shots)
        odd = np.empty((len(x), len(self.executable.source.measured)), dtype=np.int64)
        for index, parities in self._parities(x, theta):
            width = self._widths[index]
            p = np.clip(parities @ _signs(width) / 2**width, 0.0, 1.0)
            of_circuit = int(shots[index]) if isinstance(shots, np.ndarray) else shots
            counts = self._draw(rng, of_circuit, p, index)
            numbers, products = self._observables[index]
            odd[:, numbers] = counts @ (_signs(width)[:, products] < 0)
        return odd

    def _draw(self, rng: Binomial | None, shots: int, p: FloatArray, index: int) -> CountArray:
        if not isinstance(rng, RowDraws):
            return self._rng.multinomial(shots, p / p.sum(axis=1, keepdims=True))
        copies = rng.episode.size // len(p)
        copy, number = divmod(index, len(self._widths) // copies)
        first = [0, *accumulate(2**width - 1 for width in self._widths)][number]
        return rng.outcomes(shots, p, copy, first)

    def _parities(self, x: FloatArray, theta: FloatArray) -> list[tuple[int, FloatArray]]:
        """Each circuit, and the expectations of all products of Z of its own qubits, (B, 2**w)."""
        cos, sin = self.executable.bind_turns(x, theta)
        found = []
        for group in self._groups:
            parities = group.blocks.parities(cos[:, group.slots], sin[:, group.slots])
            for place, index in enumerate(group.circuits):
                # Qubits gained by routing come last, and are traced out.
                step = parities.shape[2] // 2 ** self._widths[index]
                found.append((index, parities[:, place, ::step]))
        return found


def _check_widths(native: Program, is_ideal: bool) -> None:
    widest, most = max(native.widths), MAX_IDEAL_QUBITS if is_ideal else MAX_NOISY_QUBITS
    if widest > most:
        what = "Circuits are" if is_ideal else "The noise of circuits is"
        raise CircuitError(
            f"A circuit has {widest} qubits on the device.",
            f"{what} computed on up to {most} qubits.",
        )


def _shape(circuit: Circuit) -> object:
    """Everything but the angles."""
    return tuple((gate.name, gate.qubits) for gate in circuit.gates)


def _on_circuit(program: Program, index: int) -> _Observables:
    first, width = program.first_bits[index], program.widths[index]
    found = {
        number: sum(1 << (first + width - 1 - bit) for bit in observable)
        for number, observable in enumerate(program.measured)
        if first <= observable[0] < first + width
    }
    return _Observables(np.array([*found], dtype=np.intp), np.array([*found.values()], np.intp))


def _group(executable: Executable, circuits: list[int]) -> _Group:
    native, owners = executable.native, executable.slot_circuits
    first_bits = np.array(native.first_bits)[circuits]
    bits = first_bits[:, None] + np.arange(native.circuits[circuits[0]].width)
    count = len(native.circuits[circuits[0]].angles)
    slots = [np.flatnonzero(owners == circuit)[:count] for circuit in circuits]
    members = [native.circuits[circuit] for circuit in circuits]
    device = executable.device
    blocks = (
        IdealBlocks(members)
        if device.is_ideal
        else NoisyBlocks(members, device, executable.qubits[bits])
    )
    return _Group(circuits, np.array(slots, dtype=np.intp), blocks)


@cache
def _signs(width: int) -> FloatArray:
    """(-1)**(common bits) of outcomes and products, (2**width, 2**width): symmetric."""
    signs: FloatArray = np.ones((1, 1))
    for _ in range(width):
        signs = np.asarray(np.kron(signs, [[1.0, 1.0], [1.0, -1.0]]), dtype=np.float64)
    return signs
