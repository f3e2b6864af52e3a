"""Late binding of Qiskit circuits beside the peers, in one run: `python benchmarks/late.py`.

Each row binds 1,000 sets of parameters for FakeTorino, after the circuit was transpiled once at
level 3. Pulses are sx and x of one bound circuit.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from measure import Row, compared, in_turn, show, spread
from qiskit import QuantumCircuit
from qiskit.circuit import ParameterVector
from qiskit.circuit.library import efficient_su2, real_amplitudes
from qiskit.quantum_info import Statevector
from qiskit.transpiler import PassManager, generate_preset_pass_manager
from qiskit.transpiler.passes import Optimize1qGatesDecomposition
from qiskit_ibm_runtime.fake_provider import FakeTorino

import qcompile

SETS = 1000


def skolik(layers: int = 5, qubits: int = 4) -> QuantumCircuit:
    """Skolik et al., arXiv 2103.15084: rx(x), ry and rz trained, a ring of cz."""
    x, theta = ParameterVector("x", qubits), iter(ParameterVector("t", 2 * layers * qubits))
    circuit = QuantumCircuit(qubits)
    for _ in range(layers):
        for qubit in range(qubits):
            circuit.rx(x[qubit], qubit)
            circuit.ry(next(theta), qubit)
            circuit.rz(next(theta), qubit)
        for qubit in range(qubits):
            circuit.cz(qubit, (qubit + 1) % qubits)
    return circuit


def qaoa(qubits: int = 4, layers: int = 3) -> QuantumCircuit:
    """MaxCut on a ring."""
    beta, gamma = ParameterVector("b", layers), ParameterVector("g", layers)
    circuit = QuantumCircuit(qubits)
    circuit.h(range(qubits))
    for layer in range(layers):
        for qubit in range(qubits):
            circuit.rzz(2 * gamma[layer], qubit, (qubit + 1) % qubits)
        circuit.rx(2 * beta[layer], range(qubits))
    return circuit


CIRCUITS = {
    "Skolik, 4 qubits, 5 layers": skolik(),
    "EfficientSU2, 4 qubits, 5 layers": efficient_su2(4, reps=5),
    "RealAmplitudes, 4 qubits, 5 layers": real_amplitudes(4, reps=5),
    "QAOA, 4 qubits, 3 layers": qaoa(),
}


def small(isa: QuantumCircuit) -> QuantumCircuit:
    """The transpiled circuit on the qubits it uses alone, for peers that take no idle ones."""
    used = sorted({isa.find_bit(q).index for i in isa.data for q in i.qubits})
    circuit = QuantumCircuit(len(used))
    for instruction in isa.data:
        places = [used.index(isa.find_bit(q).index) for q in instruction.qubits]
        circuit.append(instruction.operation, places)
    return circuit


def pulses(circuit: QuantumCircuit) -> int:
    counts = circuit.count_ops()
    return int(counts.get("sx", 0) + counts.get("x", 0))


def by_qiskit(circuit: QuantumCircuit, values: np.ndarray, target: Any) -> Callable[[], list[Any]]:
    """Bind each set, then fuse the gates on each qubit."""
    fuse = PassManager([Optimize1qGatesDecomposition(basis=["rz", "sx", "x"])])
    return lambda: [fuse.run(circuit.assign_parameters(row)) for row in values]


def by_level_3(circuit: QuantumCircuit, values: np.ndarray, target: Any) -> Callable[[], list[Any]]:
    """Bind each set, then transpile it again at level 3."""
    manager = generate_preset_pass_manager(3, basis_gates=["rz", "sx", "x", "cz"])
    return lambda: [manager.run(circuit.assign_parameters(row)) for row in values]


def by_cirq(circuit: QuantumCircuit, values: np.ndarray) -> Callable[[], object]:
    """Cirq's symbolic merge, with the resolvers of its sweep."""
    import cirq
    import sympy

    qubits = cirq.LineQubit.range(circuit.num_qubits)
    operations = []
    for instruction in circuit.data:
        places = [qubits[circuit.find_bit(q).index] for q in instruction.qubits]
        name = instruction.operation.name
        if name == "rz":
            angle = instruction.operation.params[0]
            symbol = angle.sympify() if hasattr(angle, "sympify") else float(angle)
            operations.append(cirq.ZPowGate(exponent=symbol / sympy.pi)(*places))
        else:
            gate = {"sx": cirq.X**0.5, "x": cirq.X, "cz": cirq.CZ}[name]
            operations.append(gate(*places))
    source = cirq.Circuit(operations)
    names = [str(parameter.sympify()) for parameter in circuit.parameters]
    sweep = cirq.Zip(*(cirq.Points(n, column) for n, column in zip(names, values.T, strict=True)))
    merge = cirq.merge_single_qubit_gates_to_phxz_symbolized
    return lambda: merge(source, sweep=sweep)


def by_pytket(circuit: QuantumCircuit, values: np.ndarray) -> Callable[[], np.ndarray]:
    """SquashCustom of a symbolic circuit once, then its expressions by sympy.lambdify."""
    import sympy
    from pytket.circuit import Circuit, OpType
    from pytket.passes import SquashCustom

    symbols = {p: sympy.Symbol(f"s{i}") for i, p in enumerate(circuit.parameters)}
    built = Circuit(circuit.num_qubits)
    for instruction in circuit.data:
        places = [circuit.find_bit(q).index for q in instruction.qubits]
        name = instruction.operation.name
        if name == "rz":
            angle = instruction.operation.params[0]
            if hasattr(angle, "sympify"):
                known = {p.sympify(): symbols[p] for p in angle.parameters}
                angle = angle.sympify().subs(known)
            built.Rz(angle / sympy.pi, *places)
        else:
            {"sx": built.SX, "x": built.X, "cz": built.CZ}[name](*places)

    def tk1(a: Any, b: Any, c: Any) -> Circuit:
        circuit = Circuit(1)
        circuit.Rz(c, 0).SX(0).Rz(b + 1, 0).SX(0).Rz(a + 1, 0)
        return circuit

    SquashCustom({OpType.Rz, OpType.SX, OpType.X}, tk1, always_squash_symbols=True).apply(built)
    angles = [a for c in built.get_commands() for a in c.op.params]
    function = sympy.lambdify([*symbols.values()], angles, modules="numpy", cse=True)
    return lambda: np.stack(np.broadcast_arrays(*(np.atleast_1d(c) for c in function(*values.T))))


def by_samplomatic(circuit: QuantumCircuit, values: np.ndarray) -> Callable[[], object]:
    """samplomatic's samplex of boxes without twirling, one set a call."""
    from samplomatic import build
    from samplomatic.transpiler import generate_boxing_pass_manager

    boxed = generate_boxing_pass_manager(
        enable_gates=True, enable_measures=False, twirling_strategy="active"
    ).run(circuit)
    _, samplex = build(boxed)

    def run() -> list[Any]:
        found = []
        for row in values:
            inputs = samplex.inputs().bind(parameter_values=row)
            found.append(samplex.sample(inputs, num_randomizations=1))
        return found

    return run


def of(name: str, wanted: str) -> list[Row]:
    """A circuit: our time beside each peer's, and the pulses of each."""
    isa = generate_preset_pass_manager(3, FakeTorino(), seed_transpiler=0).run(CIRCUITS[name])
    circuit = small(isa)
    bound = qcompile.qiskit.late(circuit)
    values = np.random.default_rng(0).uniform(-3, 3, (SETS, circuit.num_parameters))
    ours = lambda: bound.angles(values)  # noqa: E731
    template = bound.circuit.assign_parameters(ours()[0])
    fused = by_qiskit(circuit, values[:1], None)()[0]
    assert pulses(template) <= pulses(fused)
    expected = Statevector(circuit.assign_parameters(values[0]))
    assert abs(abs(Statevector(template).inner(expected)) - 1) < 1e-9
    rows = [
        spread(f"{name}: pulses, symbolic level 3", [pulses(isa)], "", ""),
        spread(f"{name}: pulses, late binding", [pulses(template)], "", ""),
        spread(f"{name}: pulses, Qiskit, bind then fuse", [pulses(fused)], "", ""),
    ]
    peers: list[tuple[str, Callable[..., Callable[[], object]], int, str]] = [
        ("Qiskit: bind, then fuse on each qubit", lambda c, v: by_qiskit(c, v, None), 100, wanted),
        ("Qiskit: bind, then level 3", lambda c, v: by_level_3(c, v, None), 20, ""),
        ("Cirq: merge symbolized", by_cirq, 50, ""),
        ("samplomatic: a samplex call a set", by_samplomatic, 50, ""),
        ("pytket: SquashCustom, lambdify", by_pytket, SETS, ""),
    ]
    for peer, make, sets, target in peers:
        try:
            theirs = make(circuit, values[:sets])
        except Exception as error:
            print(f"{name}; {peer}: {type(error).__name__}: {error}"[:300])  # noqa: T201
            continue
        pairs = in_turn(ours, theirs, 5 if sets < SETS else 15)
        rows.append(compared(f"{name}; {peer}", pairs, target, work=SETS / sets))
    return rows


def rows() -> list[Row]:
    warnings.simplefilter("ignore")
    return [row for name in CIRCUITS for row in of(name, ">= 50")]


if __name__ == "__main__":
    show(rows, "Late binding of Qiskit circuits beside the peers.")
