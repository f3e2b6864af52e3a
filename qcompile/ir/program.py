"""Programs: many circuits side by side, sharing symbols."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qcompile.errors import CircuitError
from qcompile.ir.angle import check_symbol
from qcompile.ir.circuit import Circuit, LateAngle
from qcompile.notebook import count, html_table

if TYPE_CHECKING:
    from qcompile.report.drawing import Form


@dataclass(frozen=True, repr=False)
class Program:
    """Circuits side by side, which no gate connects.

    Each qubit is a bit: those of a circuit are neighbours, its first qubit first, so that circuit i
    is bit i where every circuit has one qubit. `observables` are sets of bits of one circuit, whose
    Z are multiplied; by default each bit is one. Angles are affine in `inputs` (one value per
    observation), `parameters` (trained, the same for every observation) and the names of
    `late_angles` (computed from both when bound).

    Raises:
        CircuitError: a circuit uses a symbol that is not declared, a symbol is declared twice, or
            an observable is not a set of bits of one circuit.
    """

    circuits: tuple[Circuit, ...]
    inputs: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    late_angles: tuple[LateAngle, ...] = ()
    observables: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        if self.observables:
            self._check_observables()
        outer = (*self.inputs, *self.parameters)
        names = (*outer, *(late.name for late in self.late_angles))
        for name in names:
            check_symbol(name)
        if len(set(names)) != len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise CircuitError(f"Symbol {twice!r} is declared twice.")
        self._require(self.circuits, set(names))
        self._require([late.block for late in self.late_angles], set(outer))

    def _check_observables(self) -> None:
        first_bits, bits = self.first_bits, self.bits
        for index, observable in enumerate(self.observables):
            numbers = ",".join(map(str, observable)) or "none"
            found = f"Observable {index} has the bits {numbers}"
            if not observable or not 0 <= min(observable) <= max(observable) < bits:
                raise CircuitError(f"{found}.", f"The program has bits 0 to {bits - 1}.")
            if len(set(observable)) < len(observable):
                raise CircuitError(f"{found}: one of them twice.")
            owners = {bisect_right(first_bits, bit) - 1 for bit in observable}
            if len(owners) > 1:
                raise CircuitError(
                    f"{found}, of the circuits {' and '.join(map(str, sorted(owners)))}.",
                    "The bits of an observable belong to one circuit.",
                )
        ordered = tuple(tuple(sorted(observable)) for observable in self.observables)
        alone = tuple((bit,) for bit in range(bits))
        object.__setattr__(self, "observables", () if ordered == alone else ordered)

    @property
    def widths(self) -> tuple[int, ...]:
        """The number of qubits of each circuit."""
        return tuple(circuit.width for circuit in self.circuits)

    @property
    def is_wide(self) -> bool:
        """Whether a circuit has more than one qubit."""
        return any(circuit.width > 1 for circuit in self.circuits)

    @property
    def has_products(self) -> bool:
        """Whether a circuit has several qubits, or observables are not the bits in order."""
        return self.is_wide or bool(self.observables)

    def require_narrow(self, purpose: str, hint: str = "") -> None:
        """Check that every circuit has one qubit, and every bit is an observable, in order.

        Raises:
            CircuitError: one has more, or other observables; the message says what for they are
                needed, and `hint` what to do instead.
        """
        for index, width in enumerate(self.widths):
            if width > 1:
                raise CircuitError(
                    f"{purpose} needs circuits of one qubit: circuit {index} has {width}.",
                    hint or "docs/howto/entangling.md says what works with wider ones.",
                )
        if self.observables:
            raise CircuitError(
                f"{purpose} measures each circuit: the program has other observables.",
                hint or "Remove its observables.",
            )

    @property
    def bits(self) -> int:
        """The number of qubits of all circuits."""
        return sum(self.widths)

    @property
    def first_bits(self) -> tuple[int, ...]:
        """The first bit of each circuit."""
        return tuple(accumulate(self.widths, initial=0))[:-1]

    @property
    def measured(self) -> tuple[tuple[int, ...], ...]:
        """The bits of each observable: each bit alone unless `observables` says otherwise."""
        return self.observables or tuple((bit,) for bit in range(self.bits))

    @property
    def owners(self) -> tuple[int, ...]:
        """The circuit of each observable."""
        first_bits = self.first_bits
        return tuple(bisect_right(first_bits, bits[0]) - 1 for bits in self.measured)

    @staticmethod
    def _require(circuits: Iterable[Circuit], known: set[str]) -> None:
        for index, circuit in enumerate(circuits):
            for symbol in circuit.symbols:
                if symbol not in known:
                    raise CircuitError(
                        f"Unknown symbol {symbol!r} in circuit {index}.",
                        f"Declared: {' '.join(sorted(known)) or 'none'}.",
                    )

    @classmethod
    def of(cls, circuits: Iterable[Circuit], inputs: int = 0, parameters: int = 0) -> Program:
        """The program over x0 ... x(inputs-1) and theta0 ... theta(parameters-1)."""
        return cls(
            tuple(circuits),
            tuple(f"x{i}" for i in range(inputs)),
            tuple(f"theta{i}" for i in range(parameters)),
        )

    @classmethod
    def from_qiskit(cls, circuit: Any, inputs: str | Iterable[Any] | None = None) -> Program:
        """The program of a Qiskit QuantumCircuit, up to global phase.

        Qubits that gates connect are one circuit, and every other qubit is one. If some qubits are
        measured, observable j is the one with the j-th bit, and circuits without a measured qubit
        are left out; otherwise it is qubit j. Circuits come in the order of their first observable,
        so that circuit i is observable i where all have one qubit. Parameters whose names start
        with x are inputs and all others are parameters, unless `inputs` says otherwise: another
        prefix, a ParameterVector, or a list of Parameters and names. Both are sorted by name,
        numbers as numbers; an `inputs` list keeps its order. Element x[3] of a vector is x3.

        Raises:
            CircuitError: a gate has no definition, an angle is not affine, or a qubit is used after
                its measurement.
            MissingExtraError: Qiskit is not installed.
        """
        from qcompile.interop.qiskit import program_of

        return program_of(circuit, inputs)

    @classmethod
    def from_pennylane(
        cls, function: Any, inputs: int | tuple[int, ...] = 0, parameters: int | tuple[int, ...] = 0
    ) -> Program:
        """The program of a PennyLane quantum function, QNode or tape, up to global phase.

        The function is called once, as function(x, theta), with arrays of symbols of the shapes
        `inputs` and `parameters`; an argument of size 0 is omitted. Their elements are x0, x1, ...
        and theta0, theta1, ... in C order. Observable j is the j-th Z or product of Z measured or,
        if nothing is measured, the Z of the j-th wire the function uses; circuits are as by
        `from_qiskit`. A tape contains only numbers.

        Raises:
            CircuitError: a gate has no decomposition, an angle is not affine, the function needs
                the value of a symbol, or a product is one of wires that no gates connect.
            MissingExtraError: PennyLane is not installed.
        """
        from qcompile.interop.pennylane import program_of

        return program_of(function, inputs, parameters)

    @classmethod
    def from_qasm(
        cls, text_or_path: str | Path, inputs: str | Iterable[Any] | None = None
    ) -> Program:
        """The program of OpenQASM 2 or 3, up to global phase.

        A str that contains a line break or starts with OPENQASM is the text itself; any other str
        or a Path names a file. Circuits and observables are as by `from_qiskit`, and `inputs` means
        the same; inputs and parameters keep the order in which the file declares them.

        Raises:
            ProgramFileError: the file cannot be read, or the text cannot be compiled.
        """
        from qcompile.interop.openqasm import program_of

        return program_of(text_or_path, inputs)

    def draw(self, form: Form = "text", circuit: int | None = None) -> str:
        """The circuits as "text", "svg" or "latex" (quantikz): one of each shape, or one alone.

        Raises:
            FigureError: there is no such form or circuit.
        """
        from qcompile.report.drawing import draw_program

        return draw_program(self, form, circuit)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Inputs, parameters and the names of the late angles, in this order."""
        return (*self.inputs, *self.parameters, *(late.name for late in self.late_angles))

    def substitute(self, values: Mapping[str, float]) -> Program:
        """The program with inputs or parameters replaced by their numbers.

        Raises:
            CircuitError: the program has late angles; substitute before you compile it.
        """
        if self.late_angles:
            raise CircuitError(
                "Values cannot be substituted into a fused program.", "Substitute before compiling."
            )
        return Program(
            tuple(circuit.substitute(values) for circuit in self.circuits),
            tuple(name for name in self.inputs if name not in values),
            tuple(name for name in self.parameters if name not in values),
            observables=self.observables,
        )

    def side_by_side(self, copies: int) -> Program:
        """A program of `copies` copies of this one, with shared parameters and separate inputs.

        Inputs and circuits are ordered copy by copy. Input x of copy j is called x_j, with more
        underscores if a parameter has that name. One copy is the program itself.

        Raises:
            CircuitError: the program has late angles; copy it before you compile it.
        """
        if copies == 1:
            return self
        if self.late_angles:
            raise CircuitError("A fused program cannot be copied.", "Copy it before compiling.")
        mark = "_"
        while any(f"{x}{mark}{j}" in self.parameters for x in self.inputs for j in range(copies)):
            mark += "_"
        named = [{x: f"{x}{mark}{j}" for x in self.inputs} for j in range(copies)]
        return Program(
            tuple(circuit.rename(names) for names in named for circuit in self.circuits),
            tuple(name for names in named for name in names.values()),
            self.parameters,
            observables=tuple(
                tuple(bit + copy * self.bits for bit in observable)
                for copy in range(copies)
                for observable in self.observables
            ),
        )

    def __len__(self) -> int:
        return len(self.circuits)

    def __repr__(self) -> str:
        parts = [count(len(self), "circuit"), count(len(self.inputs), "input")]
        if self.is_wide:
            parts.insert(1, count(self.bits, "qubit"))
        parts.append(count(len(self.parameters), "parameter"))
        if self.late_angles:
            parts.append(count(len(self.late_angles), "late angle"))
        if self.observables:
            parts.append(count(len(self.observables), "observable"))
        return f"Program({', '.join(parts)})"

    def _repr_html_(self) -> str:
        rows = [[str(i), str(circuit)] for i, circuit in enumerate(self.circuits)]
        return html_table(["circuit", "gates"], rows, repr(self))

    def __str__(self) -> str:
        from qcompile.ir.text import program_text

        return program_text(self)

    @classmethod
    def parse(cls, text: str) -> Program:
        """The program with the text form (`str`) `text`.

        Raises:
            CircuitError: a line cannot be read.
        """
        from qcompile.ir.text import parse_program

        return parse_program(text)
