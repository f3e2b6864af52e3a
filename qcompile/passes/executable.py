"""The result of compilation: native circuits on physical qubits, and the binding of angles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.ir import Angle, Program
from qcompile.ir.table import AngleTable, are_large
from qcompile.native import slots
from qcompile.passes.place import copies_that_fit
from qcompile.simulate import LateAngles

if TYPE_CHECKING:
    from qcompile.report.drawing import Form
    from qcompile.report.figure import Figure
    from qcompile.report.style import AnyStyle


@dataclass(frozen=True, eq=False, repr=False)
class Executable:
    """A program compiled for a device: compiled once, then bound to angles as often as needed.

    `source` is the original program, `native` the same program in the device's gates. `qubits`
    (bits,) holds the physical qubit of each bit of the native program, `rounds` (circuits,) the
    round of each circuit. Circuits of several qubits may have gained some by routing, which come
    after their own and are in no observable.

    Each native rotation (rz, or rx where it is native) is a slot, circuit by circuit; a circuit
    without a rotation has one unused slot. At level 2 a circuit has at most one rotation, so slot i
    belongs to circuit i. `predistort` changes the angles (B, slots) of level 2 after they are
    bound; `mitigation.predistorted` sets it.
    """

    source: Program
    native: Program
    device: Device
    level: int
    qubits: IntArray
    rounds: IntArray
    predistort: Callable[[FloatArray], FloatArray] | None = None

    @property
    def bit_qubits(self) -> IntArray:
        """The physical qubit of each bit of the source program, (bits,)."""
        source, native = self.source, self.native
        owner = np.repeat(np.arange(len(source)), source.widths)
        shift = np.subtract(native.first_bits, source.first_bits)[owner]
        return np.asarray(self.qubits[np.arange(source.bits) + shift])

    @property
    def slot_circuits(self) -> IntArray:
        """The circuit of each slot, (slots,)."""
        return self._slots[0]

    @property
    def slot_positions(self) -> IntArray:
        """The position of each slot within its circuit, (slots,): 0, 1, ..."""
        return self._slots[1]

    def bind(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The native angles for x (B, inputs) and theta (parameters,), in radians: (B, slots).

        Unused slots hold 0. Angles so large that adding them would round are reduced modulo 2 pi,
        exactly.

        Raises:
            CircuitError: x or theta has the wrong shape.
        """
        self._check(x, theta)
        rows = len(x)
        if self._late_angles is not None:
            values = self._late_angles(x, theta)
            x = np.concatenate([x, values], axis=1) if self._mixed else values
        angles = self._table(x, theta, large=are_large(x, theta, self._table.largest))
        if angles.ndim == 1:
            angles = np.broadcast_to(angles, (rows, angles.size))
        return np.asarray(angles if self.predistort is None else self.predistort(angles))

    def bind_turns(self, x: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the angles that `bind` returns, each (B, slots).

        If `has_polar_angles`, they are computed from `<Z>` without trigonometry.
        """
        if self._late_angles is None or not self.has_polar_angles or self.predistort is not None:
            angles = self.bind(x, theta)
            return np.cos(angles), np.sin(angles)
        self._check(x, theta)
        z = self._late_angles.polar_cosines(x, theta)
        sine = np.sqrt(1.0 - z * z)
        return (-z, -sine) if self.device.native.angle_offset_rad else (z, sine)

    @cached_property
    def has_polar_angles(self) -> bool:
        """Whether slot i is polar angle i, in [0, pi], plus the offset of the native gates."""
        if self._late_angles is None or not self._late_angles.are_polar:
            return False
        offset = self.device.native.angle_offset_rad
        polar = [(Angle.symbol(late.name) + offset,) for late in self.native.late_angles]
        return [circuit.angles for circuit in self.native.circuits] == polar

    def _check(self, x: FloatArray, theta: FloatArray) -> None:
        inputs, parameters = len(self.source.inputs), len(self.source.parameters)
        if _shape(x)[1:] != (inputs,) or _shape(theta) != (parameters,):
            raise CircuitError(
                f"x {_described(x)} and theta {_described(theta)}.",
                f"The program needs (B, {inputs}) and ({parameters},), arrays of real numbers.",
            )

    @cached_property
    def _slots(self) -> tuple[IntArray, IntArray]:
        return slots(self.native.circuits)

    @cached_property
    def _slot_angles(self) -> tuple[Angle | None, ...]:
        """The angle of each slot; None if the slot is unused."""
        unused = (None,)
        return tuple(a for circuit in self.native.circuits for a in circuit.angles or unused)

    @cached_property
    def _late_angles(self) -> LateAngles | None:
        native = self.native
        if not native.late_angles:
            return None
        return LateAngles(native.late_angles, native.inputs, native.parameters)

    @cached_property
    def _mixed(self) -> bool:
        """Whether slots use inputs of the program besides the late angles."""
        used = {s for circuit in self.native.circuits for s in circuit.symbols}
        return not used.isdisjoint(self.native.inputs)

    @cached_property
    def _table(self) -> AngleTable:
        angles = [Angle() if angle is None else angle for angle in self._slot_angles]
        defined = tuple(late.name for late in self.native.late_angles)
        inputs = (*self.native.inputs, *defined) if self._mixed or not defined else defined
        return AngleTable(angles, inputs, self.native.parameters)

    def __str__(self) -> str:
        return str(self.native)

    def __repr__(self) -> str:
        where = f"{self.device.name}, level {self.level}, rounds {self.round_count}"
        return f"Executable({len(self.native)} circuits on {where})"

    @property
    def round_count(self) -> int:
        return int(self.rounds.max(initial=-1)) + 1

    @property
    def copies_that_fit(self) -> int:
        """How many copies of the program fit side by side in one round, at least 1.

        It is 1 on the ideal device, where running copies side by side saves nothing.
        """
        return copies_that_fit(self.source, self.device)

    def to_qiskit(
        self, x: FloatArray | None = None, theta: FloatArray | None = None, *, measure: bool = True
    ) -> list[Any]:
        """A Qiskit QuantumCircuit for each round, on the physical qubits of the device.

        The circuits have native gates only. Without x (inputs,) and theta (parameters,) the open
        angles are parameters a{i}_{k} for slot k of circuit i, whose values `bind` returns; with
        both, the circuits contain numbers. Register c has a bit for each qubit of the source
        circuits of the round, in order: for each circuit, where those have one. Qubits gained by
        routing are not measured. `measure=False` omits the measurements and the register.

        Raises:
            CircuitError: x or theta has the wrong shape, or only one of them is given.
            MissingExtraError: Qiskit is not installed.
        """
        from qcompile.interop.qiskit import circuits_of

        return circuits_of(self, x, theta, measure=measure)

    def draw(self, form: Form = "text", circuit: int | None = None) -> str:
        """The circuits before and after compilation, as `Program.draw` draws them.

        Raises:
            FigureError: there is no such form or circuit.
        """
        from qcompile.report.drawing import draw_executable

        return draw_executable(self, form, circuit)

    def plot_map(self, style: AnyStyle = None) -> Figure:
        """The device's qubits and couplings by their errors, those that the circuits use marked.

        Raises:
            FigureError: the device has no couplings; the style cannot be read.
        """
        from qcompile.report.device_map import draw_executable_map

        return draw_executable_map(self, style)

    def gate_counts(self) -> list[Counter[str]]:
        """The number of native gates of each circuit, by name."""
        return [Counter(gate.name for gate in c.gates) for c in self.native.circuits]

    @cached_property
    def open_slots(self) -> IntArray:
        """The slots whose angles are unknown before binding, in order.

        With `predistort` they include constant angles, because it changes those too.
        """
        known = self.predistort is None
        is_open = [a is not None and not (known and a.is_constant) for a in self._slot_angles]
        return np.flatnonzero(is_open)

    def template(
        self, numbers: Sequence[int] | None = None, taken: Collection[str] = ()
    ) -> Program:
        """The native circuits with an input for each of the `open_slots`, in that order.

        Slot k of circuit i is the input a{i}_{k}; `bind` returns its value. `numbers` replace
        0, 1, ... as the circuit numbers i. If a name is `taken`, more underscores follow the a.
        """
        numbers = range(len(self.native)) if numbers is None else numbers
        prefix = "a"
        while any(name.startswith(prefix) and name[len(prefix) :][:1].isdigit() for name in taken):
            prefix += "_"
        angles, names = list(self._slot_angles), []
        for slot in self.open_slots.tolist():
            circuit, position = self.slot_circuits[slot], self.slot_positions[slot]
            names.append(f"{prefix}{numbers[circuit]}_{position}")
            angles[slot] = Angle.symbol(names[-1])
        circuits, start = [], 0
        for circuit in self.native.circuits:
            stop = start + max(len(circuit.angles), 1)
            circuits.append(circuit.with_angles(filter(None, angles[start:stop])))
            start = stop
        return Program(tuple(circuits), tuple(names))


def _shape(array: Any) -> tuple[int, ...]:
    """The shape of an array of real numbers; () for any other value."""
    dtype = getattr(array, "dtype", None)
    if not isinstance(dtype, np.dtype) or dtype.kind not in "biuf":
        return ()
    is_plain = type(array) is np.ndarray or not hasattr(array, "mask")
    return tuple(array.shape) if is_plain else ()


def _described(array: Any) -> str:
    """The shape or type of an argument, for messages."""
    if not isinstance(array, np.ndarray):
        return f"has type {type(array).__name__}"
    masked = ", masked," if hasattr(array, "mask") else ""
    numbers = "" if array.dtype.kind in "biuf" else f" of {array.dtype}"
    return f"has shape {array.shape}{numbers}{masked}"
