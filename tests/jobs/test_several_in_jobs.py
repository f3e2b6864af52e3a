"""Jobs of policies with circuits of several qubits: job.json, and programs read back by others."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm2, qasm3
from qiskit.quantum_info import Pauli, Statevector
from several import measured, product

from qcompile.device import IDEAL, Device, load_device
from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.jobs.policy_job import export_job
from qcompile.passes import LEVELS, compile
from qcompile.policy import Encoder, Policy

RING = "cz@0,1 cz@1,2 cz@2,3 cz@3,0"
FOUR = (
    f"ry(x0)@0 ry(x1)@1 ry(theta0)@2 rx(x2)@3 {RING} ry(theta1)@0 rx(x1)@1 ry(x2+theta0)@2 cx@0,2"
)
PROGRAM = Program(
    (
        Circuit.parse(FOUR, 4),
        Circuit.parse("h ry(x0) rz(x0) ry(theta0)"),
        Circuit.parse("ry(x2)@0 ecr@0,1 ry(x1)@1 cx@1,0", 2),
    ),
    ("x0", "x1", "x2"),
    ("theta0", "theta1"),
    observables=((0,), (1, 3), (0, 1, 2, 3), (4,), (5, 6)),
)
POLICY = Policy(
    "several",
    "any",
    Encoder("arctan", np.array([2, 0, 1]), np.array([1.0, 2.0, 0.5])),
    PROGRAM,
    np.array([0.7, -2.1]),
    np.ones((2, 5)),
    np.zeros(2),
)
OBSERVATIONS = np.vstack([np.random.default_rng(0).normal(size=(2, 3)), np.zeros(3)])
"""The last row has angles at quarter turns, where fewer gates would do."""
DEVICES = [IDEAL, *map(load_device, ("fake_lima", "fake_jakarta", "fake_fez"))]


@pytest.fixture(scope="module")
def wanted() -> np.ndarray:
    """<O> of every observable for every observation, by Qiskit's statevector."""
    rows = []
    for x in POLICY.encode(OBSERVATIONS):
        values = dict(zip((*PROGRAM.inputs, *PROGRAM.parameters), (*x, *POLICY.theta), strict=True))
        built = QuantumCircuit(PROGRAM.bits)
        for circuit, first in zip(PROGRAM.circuits, PROGRAM.first_bits, strict=True):
            for gate in circuit.gates:
                angles = () if gate.angle is None else (eval(str(gate.angle), {}, values),)
                getattr(built, gate.name)(*angles, *(first + qubit for qubit in gate.qubits))
        state = Statevector(built)
        observed = ((Pauli("Z" * len(bits)), list(bits)) for bits in PROGRAM.observables)
        rows.append([state.expectation_value(*each).real for each in observed])
    return np.array(rows)


def reader(text: str) -> QuantumCircuit:
    return qasm2.loads(text) if text.startswith("OPENQASM 2") else qasm3.loads(text)


def by_qiskit(text: str) -> np.ndarray:
    """The distribution of the bits of c, the first one lowest."""
    return measured(reader(text))[1]


def by_pytket(text: str) -> np.ndarray:
    from pytket import Circuit as TketCircuit
    from pytket import OpType
    from pytket.qasm import circuit_from_qasm_str

    read = circuit_from_qasm_str(text)
    gates, qubit_of = TketCircuit(read.n_qubits), {}
    for command in read.get_commands():
        qubits = [qubit.index[0] for qubit in command.qubits]
        if command.op.type == OpType.Measure:
            qubit_of[command.bits[0].index[0]] = qubits[0]
        else:
            gates.add_gate(command.op, qubits)
    return of_state(gates.get_statevector(), qubit_of)


def by_cirq(text: str) -> np.ndarray:
    import cirq
    from cirq.contrib.qasm_import import circuit_from_qasm

    size = int(re.search(r"qreg q\[(\d+)\]", text)[1])  # type: ignore[index]
    read = circuit_from_qasm(text)
    gates = cirq.Circuit(op for op in read.all_operations() if not cirq.is_measurement(op))
    order = [cirq.NamedQubit(f"q_{i}") for i in range(size)]
    places = re.findall(r"measure q\[(\d+)\] -> c\[(\d+)\];", text)
    simulator = cirq.Simulator(dtype=np.complex128)
    state = simulator.simulate(gates, qubit_order=order).final_state_vector
    return of_state(state, {int(bit): int(qubit) for qubit, bit in places})


def of_state(state: np.ndarray, qubit_of: Mapping[int, int]) -> np.ndarray:
    """The distribution of bits in a state whose first qubit is the most significant."""
    qubits = int(np.log2(state.size))
    chosen = [qubit_of[bit] for bit in range(len(qubit_of))]
    table = (np.abs(state) ** 2).reshape([2] * qubits)
    others = tuple(sorted({*range(qubits)} - {*chosen}))
    left = sorted(chosen)
    order = [left.index(qubit) for qubit in reversed(chosen)]
    return np.asarray(table.sum(axis=others).transpose(order).ravel())


def observed(
    job: Mapping[str, Any], folder: Path, of_text: Callable[[str], np.ndarray]
) -> np.ndarray:
    """<O> of all observables, (rows, observables), from the files of a bound job."""
    found = np.full((len(OBSERVATIONS), len(PROGRAM.observables)), np.nan)
    for program in job["programs"]:
        probabilities = of_text((folder / program["file"]).read_text())
        for number, bits in enumerate(PROGRAM.observables):
            if {*bits} <= {*program["bits"]}:
                assert np.isnan(found[program["observation"], number])
                places = [program["bits"].index(bit) for bit in bits]
                found[program["observation"], number] = product(probabilities, places)
    return found


@pytest.mark.parametrize("format", ["qasm3", "qasm2"])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.name)
def test_a_bound_job_is_the_policy(
    tmp_path: Path, wanted: np.ndarray, device: Device, level: int, format: Any
) -> None:
    folder = tmp_path / "job"
    job = export_job(POLICY, device, folder, level=level, format=format, observations=OBSERVATIONS)
    np.testing.assert_allclose(observed(job, folder, by_qiskit), wanted, atol=1e-9)
    rounds = {tuple(program["qubits"]) for program in job["programs"]}
    assert len(rounds) == len(job["programs"]) / len(OBSERVATIONS)
    for program in job["programs"] if not device.is_ideal else ():
        text = (folder / program["file"]).read_text()
        couplings = re.findall(r"^(\w+) (?:\$|q\[)(\d+)\]?, (?:\$|q\[)(\d+)\]?;", text, re.M)
        assert couplings
        for name, first, second in couplings:
            assert (name, int(first), int(second)) in device.coupling_calibrations
        form = "c[{0}] = measure ${1};" if format == "qasm3" else "measure q[{1}] -> c[{0}];"
        for bit, qubit in enumerate(program["qubits"]):
            assert form.format(bit, qubit) in text


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
@pytest.mark.parametrize("of_text", [by_pytket, by_cirq])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("device", DEVICES[:2], ids=lambda device: device.name)
def test_other_packages_find_the_policy_s_expectations(
    tmp_path: Path,
    wanted: np.ndarray,
    device: Device,
    level: int,
    of_text: Callable[[str], np.ndarray],
) -> None:
    pytest.importorskip("pytket.qasm" if of_text is by_pytket else "cirq.contrib.qasm_import")
    folder = tmp_path / "job"
    job = export_job(
        POLICY, device, folder, level=level, format="qasm2", observations=OBSERVATIONS[1:2]
    )
    np.testing.assert_allclose(observed(job, folder, of_text)[:1], wanted[1:2], atol=1e-9)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("device", DEVICES[:2], ids=lambda device: device.name)
def test_a_parametric_job_is_the_policy(
    tmp_path: Path, wanted: np.ndarray, device: Device, level: int
) -> None:
    """Its inputs are encoded features at level 0, and above it what `bind` returns."""
    job = export_job(POLICY, device, tmp_path / "job", level=level)
    assert job == json.loads((tmp_path / "job" / "job.json").read_text())
    x = POLICY.encode(OBSERVATIONS)
    executable = compile(POLICY.trained_program, device, level, POLICY.importance)
    slots = executable.bind(x, np.zeros(0))
    place = {
        f"a{circuit}_{position}": slot
        for slot, (circuit, position) in enumerate(
            zip(executable.slot_circuits, executable.slot_positions, strict=True)
        )
    }
    found = np.full_like(wanted, np.nan)
    for program in job["programs"]:
        circuit = reader((tmp_path / "job" / program["file"]).read_text())
        assert {parameter.name for parameter in circuit.parameters} == {*program["inputs"]}
        for row in range(len(x)):
            values = {
                name: x[row, int(name[1:])] if level == 0 else slots[row, place[name]]
                for name in program["inputs"]
            }
            probabilities = measured(circuit.assign_parameters(values))[1]
            for number, bits in enumerate(PROGRAM.observables):
                if {*bits} <= {*program["bits"]}:
                    places = [program["bits"].index(bit) for bit in bits]
                    found[row, number] = product(probabilities, places)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_job_json_names_the_bits_of_wide_programs_only(tmp_path: Path) -> None:
    job = export_job(POLICY, DEVICES[1], tmp_path / "job")
    assert [program["circuits"] for program in job["programs"]] == [[0, 1], [2]]
    assert [program["bits"] for program in job["programs"]] == [[0, 1, 2, 3, 4], [5, 6]]
    assert all(len(p["qubits"]) == len(p["bits"]) for p in job["programs"])
    narrow = Policy(
        "one",
        "any",
        Encoder("arctan", np.zeros(1, dtype=int), np.ones(1)),
        Program.of([Circuit.parse("ry(x0)")], 1),
        np.zeros(0),
        np.ones((2, 1)),
        np.zeros(2),
    )
    (program,) = export_job(narrow, DEVICES[1], tmp_path / "other")["programs"]
    assert "bits" not in program


def test_rows_at_quarter_turns_have_the_gates_of_the_others(tmp_path: Path) -> None:
    """A routed circuit would come out on other qubits, if it were compiled again."""
    folder = tmp_path / "job"
    export_job(POLICY, DEVICES[2], folder, observations=OBSERVATIONS)
    texts = [(folder / f"observation{row}-round0.qasm").read_text() for row in (0, 2)]
    first, last = (re.sub(r"\(.*\)", "", text) for text in texts)
    assert first == last


def test_openqasm_2_needs_observations(tmp_path: Path) -> None:
    with pytest.raises(CircuitError, match="Give --observations FILE"):
        export_job(POLICY, IDEAL, tmp_path / "job", format="qasm2")
