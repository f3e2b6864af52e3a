"""Every pass and every level keeps exactly its promise, against Qiskit's gate matrices."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st
from qiskit.circuit import library

from qcompile.device import IDEAL, Device, Qubit
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate, Program
from qcompile.native import RX, SX
from qcompile.passes import LEVELS, PASSES, Pass, compile, pipeline
from qcompile.passes.fuse_rotations import FuseRotations
from qcompile.passes.to_native import ToNative
from qcompile.simulate import LateAngles

TOLERANCE = 1e-12
SYMBOLS = ("x0", "x1", "theta0", "theta1")
SPECIAL = (0, math.pi / 2, -math.pi / 2, math.pi, -math.pi, 2 * math.pi, 1e-9, 1e-14, -1e-14)
GATE_CLASSES = {
    "id": library.IGate, "x": library.XGate, "y": library.YGate, "z": library.ZGate,
    "h": library.HGate, "s": library.SGate, "sdg": library.SdgGate, "t": library.TGate,
    "tdg": library.TdgGate, "sx": library.SXGate, "sxdg": library.SXdgGate,
    "rx": library.RXGate, "ry": library.RYGate, "rz": library.RZGate, "p": library.PhaseGate,
}  # fmt: skip
FIXED_MATRICES = {name: GATE_CLASSES[name]().to_matrix() for name in FIXED_GATES}

# A pass's own input: (pass, the gates it is made for).
STEPS: dict[str, tuple[tuple[Pass, ...], tuple[str, ...]]] = {
    cls.name: ((cls(),), ("rz", "ry") if cls is FuseRotations else tuple(GATE_CLASSES))
    for cls in PASSES
}
STEPS["to_native rz rx"] = ((ToNative(RX),), tuple(GATE_CLASSES))
for level in LEVELS:
    for native in (SX, RX):
        STEPS[f"level {level} {native}"] = (pipeline(level, native), tuple(GATE_CLASSES))

Values = Mapping[str, float]


def value(angle: Angle, values: Values) -> float:
    return angle.constant + sum(c * values[s] for s, c in angle.terms)


def unitary(circuit: Circuit, values: Values) -> np.ndarray:
    """The circuit's unitary from Qiskit's own gate matrices."""
    result = np.eye(2)
    for gate in circuit.gates:
        if gate.angle is None:
            matrix = FIXED_MATRICES[gate.name]
        else:
            matrix = GATE_CLASSES[gate.name](value(gate.angle, values)).to_matrix()
        result = matrix @ result
    return result


def difference(first: np.ndarray, second: np.ndarray, promise: str) -> float:
    if promise == "distribution":
        return abs(abs(first[1, 0]) ** 2 - abs(second[1, 0]) ** 2)
    overlap = np.trace(first.conj().T @ second)
    phase = overlap / abs(overlap) if abs(overlap) > 1e-6 else 1.0
    return float(np.abs(first * phase - second).max())


def promise_of(passes: tuple[Pass, ...]) -> str:
    kept = {step.keeps for step in passes}
    assert kept <= {"unitary", "distribution"}
    return "distribution" if "distribution" in kept else "unitary"


def apply(passes: tuple[Pass, ...], program: Program) -> Program:
    for step in passes:
        program = step.apply(program)
    return program


def broken(passes: tuple[Pass, ...], program: Program, points: np.ndarray) -> list[str]:
    """Where the promise fails at `points` (B, symbols): one line for each circuit and point."""
    after, promise, lines = apply(passes, program), promise_of(passes), []
    assert len(after) == len(program)
    theta = points[0, len(program.inputs) :]
    defined = np.zeros((len(points), 0))
    if after.late_angles:
        late_angles = LateAngles(after.late_angles, program.inputs, program.parameters)
        defined = late_angles(points[:, : len(program.inputs)], theta)
    names = [late.name for late in after.late_angles]
    for point, extra in zip(points, defined, strict=True):
        point = [*point[: len(program.inputs)], *theta]
        values = dict(zip([*program.inputs, *program.parameters], point, strict=True))
        extended = values | dict(zip(names, extra, strict=True))
        for before, now in zip(program.circuits, after.circuits, strict=True):
            gap = difference(unitary(before, values), unitary(now, extended), promise)
            if not gap <= TOLERANCE:
                lines.append(f"{before} -> {now} at {extended}: {promise} differs by {gap:.2e}")
    return lines


class Random:
    """Random circuits of 0 to 12 gates, their angles numbers, or affine where `symbols` are."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)

    def angle(self, symbols: tuple[str, ...]) -> Angle:
        rng = self.rng
        special = rng.random() < 0.6
        number = rng.choice(SPECIAL) if special else rng.uniform(-7, 7)
        angle = Angle.of(float(number))
        if symbols and rng.random() < 0.6:
            for symbol in rng.choice(symbols, rng.integers(1, 3), replace=False):
                factor = rng.choice([1.0, -1.0, 0.5]) if rng.random() < 0.7 else rng.normal()
                angle += Angle.symbol(str(symbol)) * float(factor)
        return angle

    def circuit(self, gates: tuple[str, ...], symbols: tuple[str, ...]) -> Circuit:
        names = self.rng.choice(gates, self.rng.integers(0, 13))
        return Circuit(
            tuple(Gate(str(n), self.angle(symbols) if n in ROTATION_GATES else None) for n in names)
        )

    def program(self, size: int, gates: tuple[str, ...], bound: bool) -> Program:
        symbols = () if bound else SYMBOLS
        circuits = [self.circuit(gates, symbols) for _ in range(size)]
        return Program.of(circuits) if bound else Program.of(circuits, 2, 2)


@pytest.mark.parametrize("bound", [True, False], ids=["bound", "symbolic"])
@pytest.mark.parametrize("step", STEPS)
def test_the_promise_on_random_circuits(step: str, bound: bool) -> None:
    passes, gates = STEPS[step]
    random = Random(seed=sorted(STEPS).index(step) * 2 + bound)
    program = random.program(1500 if bound else 750, gates, bound)
    points = random.rng.uniform(-4, 4, (1 if bound else 2, len(program.symbols)))
    assert broken(passes, program, points) == []


@pytest.mark.parametrize("step", STEPS)
def test_the_promise_where_symbols_take_special_values(step: str) -> None:
    passes, gates = STEPS[step]
    random = Random(seed=1000 + sorted(STEPS).index(step))
    program = random.program(300, gates, bound=False)
    for _ in range(2):
        assert broken(passes, program, random.rng.choice(SPECIAL, (1, 4))) == []


angles = st.one_of(st.sampled_from(SPECIAL), st.floats(-10, 10, allow_subnormal=False))
factors = st.one_of(st.sampled_from([1.0, -1.0, 0.5]), st.floats(-3, 3, allow_subnormal=False))
affine = st.builds(
    lambda number, terms: sum((Angle.symbol(s) * c for s, c in terms.items()), Angle.of(number)),
    angles,
    st.dictionaries(st.sampled_from(SYMBOLS), factors, max_size=2),
)


def circuits(gates: tuple[str, ...]) -> st.SearchStrategy[Circuit]:
    def gate(name: str) -> st.SearchStrategy[Gate]:
        return (
            affine.map(lambda a: Gate(name, a)) if name in ROTATION_GATES else st.just(Gate(name))
        )

    drawn = st.sampled_from(gates).flatmap(gate)
    return st.lists(drawn, max_size=12).map(lambda made: Circuit(tuple(made)))


@pytest.mark.parametrize("step", STEPS)
def test_the_promise_with_shrinking(step: str) -> None:
    passes, gates = STEPS[step]

    @settings(max_examples=60, deadline=None, derandomize=True, database=None)
    @given(circuits(gates), st.lists(angles, min_size=4, max_size=4))
    def check(circuit: Circuit, point: list[float]) -> None:
        note(f"{step}: {circuit} at {point}")
        program = Program.of([circuit], 2, 2)
        assert broken(passes, program, np.array([point])) == []

    check()


@pytest.mark.parametrize("step", STEPS)
def test_the_input_is_never_changed(step: str) -> None:
    passes, gates = STEPS[step]
    program = Random(seed=9).program(50, gates, bound=False)
    text, marked = str(program), hash(program)
    apply(passes, program)
    assert (str(program), hash(program)) == (text, marked)


def test_the_check_sees_a_broken_promise() -> None:
    class Wrong:
        name, keeps = "wrong", "unitary"

        def apply(self, program: Program) -> Program:
            return Program.of([Circuit.parse("s sx")], 2, 2)

    one = Program.of([Circuit.parse("sx s")], 2, 2)
    assert broken((Wrong(),), one, np.zeros((1, 4)))
    Wrong.keeps = "distribution"
    assert not broken((Wrong(),), one, np.zeros((1, 4)))


@pytest.mark.parametrize("basis", [("rz", "sx", "x"), ("rz", "rx")])
@pytest.mark.parametrize("level", LEVELS)
def test_bound_slots_are_the_native_circuits(level: int, basis: tuple[str, ...]) -> None:
    """What an executable sends, its native gates with the slots that bind gives, is the source."""
    qubit = Qubit(t1_us=100, t2_us=100, p10=0, p01=0)
    device = (
        IDEAL
        if "sx" in basis
        else Device(name="rx", source="test", basis_gates=basis, qubits=(qubit,))
    )
    random = Random(seed=40 + level)
    program = random.program(200, tuple(GATE_CLASSES), bound=False)
    x, theta = random.rng.uniform(-4, 4, (3, 2)), random.rng.uniform(-4, 4, 2)
    executable = compile(program, device, level)
    slots, of_circuit = executable.bind(x, theta), executable.slot_circuits
    if level == 2:
        np.testing.assert_array_equal(of_circuit, np.arange(200))
    promise = "distribution" if level == 2 else "unitary"
    for point, bound in zip(x, slots, strict=True):
        row = [bound[of_circuit == circuit] for circuit in range(200)]
        values = dict(zip(SYMBOLS, [*point, *theta], strict=True))
        for before, native, angles in zip(
            program.circuits, executable.native.circuits, row, strict=True
        ):
            numbers = iter(angles)
            sent = [
                gate if gate.angle is None else Gate.of(gate.name, float(next(numbers)))
                for gate in native.gates
            ]
            assert [*numbers] == [0.0] * (not native.angles)  # of the slot that is not used
            gap = difference(unitary(before, values), unitary(Circuit(tuple(sent)), {}), promise)
            assert gap <= TOLERANCE, f"{before} -> {native} with {angles}"
