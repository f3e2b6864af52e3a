"""Programs with circuits of several qubits on a noise model: parities, and counts of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray, IntArray
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.execution.prepared import Binomial, ExactPrepared, largest_shots
from qcompile.ir import Circuit, Program
from qcompile.limits import MAX_DENSITY_QUBITS, MAX_PAULI_QUBITS, MAX_STATE_QUBITS
from qcompile.passes import Executable
from qcompile.states.density import DensityBlocks
from qcompile.states.ideal import IdealBlocks
from qcompile.states.parities import signed_sums
from qcompile.states.pauli import NoisyBlocks
from qcompile.streams.draws import RowDraws

Blocks = IdealBlocks | NoisyBlocks | DensityBlocks


class _Group(NamedTuple):
    """Circuits of one shape, evaluated together.

    `slots` are (circuits, slots of each). Observable `numbers[k]` of the program is product
    `products[k]` of Z of circuit `places[k]` of the group.
    """

    circuits: IntArray
    width: int
    slots: IntArray
    blocks: Blocks
    numbers: IntArray
    places: IntArray
    products: IntArray


class PreparedWide(ExactPrepared):
    """An executable with circuits of several qubits, with the noise of its qubits and couplings.

    Without noise the state is a statevector; with noise up to 8 qubits a Pauli vector of `dtype`,
    and above Aer's density matrix.

    Raises:
        CircuitError: a circuit has too many qubits.
        MissingExtraError: a circuit needs Aer, which is not installed.
    """

    def __init__(self, executable: Executable, rng: np.random.Generator, dtype: Any = np.float64):
        super().__init__(executable, rng)
        source, native = executable.source, executable.native
        _check_widths(native, executable.device)
        self._widths = source.widths
        shapes: dict[object, list[int]] = {}
        for index, circuit in enumerate(native.circuits):
            key = source.widths[index], circuit.width, _shape(circuit)
            shapes.setdefault(key, []).append(index)
        self._groups = [_group(executable, circuits, dtype) for circuits in shapes.values()]

    def expectation(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        result = np.empty((len(x), len(self.executable.source.measured)))
        for group, parities in self._parities(x, theta):
            result[:, group.numbers] = parities[:, group.places, group.products]
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
        for group, parities in self._parities(x, theta):
            p = np.clip(signed_sums(parities) / 2**group.width, 0.0, 1.0)
            of_group = shots[group.circuits] if isinstance(shots, np.ndarray) else shots
            counts = signed_sums(self._draw(rng, of_group, p, group))
            odd_counts = (counts[:, :, :1] - counts) // 2  # product 0 counts all shots
            odd[:, group.numbers] = odd_counts[:, group.places, group.products]
        return odd

    def _draw(
        self, rng: Binomial | None, shots: CircuitShots, p: FloatArray, group: _Group
    ) -> CountArray:
        """Counts of the outcomes, (B, circuits of the group, 2**width)."""
        if not isinstance(rng, RowDraws):
            return self._rng.multinomial(shots, p / p.sum(axis=-1, keepdims=True))
        of_copy = len(self._widths) // (rng.episode.size // len(p))
        before = np.cumsum([0, *(2**width - 1 for width in self._widths[:of_copy])])
        copy, number = np.divmod(group.circuits, of_copy)
        return rng.outcomes(shots, p, copy, before[number])

    def _parities(self, x: FloatArray, theta: FloatArray) -> Iterator[tuple[_Group, FloatArray]]:
        """Each group, and the expectations of all products of Z, (B, circuits, 2**width)."""
        cos, sin = self.executable.bind_turns(x, theta)
        for group in self._groups:
            parities = group.blocks.parities(cos[:, group.slots], sin[:, group.slots])
            # Qubits gained by routing come last, and are traced out.
            step = parities.shape[2] // 2**group.width
            yield group, parities[:, :, ::step].astype(np.float64, copy=False)


def _check_widths(native: Program, device: Device) -> None:
    widest = max(native.widths)
    most = MAX_STATE_QUBITS if device.is_ideal else MAX_DENSITY_QUBITS
    if widest > most:
        raise CircuitError(
            f"A circuit has {widest} qubits on {device.name}.",
            f"Circuits are computed on up to {most} qubits there.",
        )


def _shape(circuit: Circuit) -> object:
    """Everything but the angles."""
    return tuple((gate.name, gate.qubits) for gate in circuit.gates)


def _group(executable: Executable, circuits: list[int], dtype: Any) -> _Group:
    source, native, owners = executable.source, executable.native, executable.slot_circuits
    width = source.widths[circuits[0]]
    first_bits = np.array(native.first_bits)[circuits]
    bits = first_bits[:, None] + np.arange(native.circuits[circuits[0]].width)
    count = len(native.circuits[circuits[0]].angles)
    slots = [np.flatnonzero(owners == circuit)[:count] for circuit in circuits]
    members = [native.circuits[circuit] for circuit in circuits]
    blocks = _blocks(members, executable.device, executable.qubits[bits], dtype)
    place_of_bit = {
        source.first_bits[circuit] + bit: (place, 1 << (width - 1 - bit))
        for place, circuit in enumerate(circuits)
        for bit in range(width)
    }
    observables = [
        (number, place_of_bit[observable[0]][0], sum(place_of_bit[bit][1] for bit in observable))
        for number, observable in enumerate(source.measured)
        if observable[0] in place_of_bit
    ]
    numbers, places, products = np.array(observables, dtype=np.intp).reshape(-1, 3).T
    indices = np.array(circuits, dtype=np.intp), width, np.array(slots, dtype=np.intp)
    return _Group(*indices, blocks, numbers, places, products)


def _blocks(circuits: list[Circuit], device: Device, qubits: IntArray, dtype: Any) -> Blocks:
    if device.is_ideal:
        return IdealBlocks(circuits)
    if circuits[0].width > MAX_PAULI_QUBITS:
        return DensityBlocks(circuits, device, qubits)
    return NoisyBlocks(circuits, device, qubits, dtype)
