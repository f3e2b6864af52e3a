"""What `export` writes for the shipped LunarLander policy, read by Qiskit, pytket and Cirq."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import qcompile
from qcompile.jobs.policy_job import export_job

POLICY = qcompile.load_policy("lunarlander")
OBSERVATIONS = np.random.default_rng(5).normal(size=(3, 8))


def closed_form() -> np.ndarray:
    """<Z> of arXiv 2203.14348 for every circuit: -sin(x) cos(theta) - cos(x)^2 sin(theta)."""
    encoder, theta = POLICY.encoder, POLICY.theta
    x = np.arctan(OBSERVATIONS[:, encoder.feature] * encoder.scale)
    return -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)


def expectations(state: np.ndarray) -> np.ndarray:
    """<Z> of each qubit of a state vector, qubit 0 the most significant."""
    qubits = int(np.log2(state.size))
    table = (np.abs(state) ** 2).reshape([2] * qubits)
    return np.array([1 - 2 * np.moveaxis(table, i, 0)[1].sum() for i in range(qubits)])


def by_qiskit(text: str) -> np.ndarray:
    from qiskit import qasm2, qasm3
    from qiskit.quantum_info import Statevector

    circuit = qasm3.loads(text) if text.startswith("OPENQASM 3") else qasm2.loads(text)
    circuit.remove_final_measurements()
    return expectations(Statevector(circuit.reverse_bits()).data)


def by_pytket(text: str) -> np.ndarray:
    from pytket import Circuit, OpType
    from pytket.qasm import circuit_from_qasm_str

    read = circuit_from_qasm_str(text)
    gates = Circuit(read.n_qubits)
    for command in read.get_commands():
        if command.op.type != OpType.Measure:
            gates.add_gate(command.op, [qubit.index[0] for qubit in command.qubits])
    return expectations(gates.get_statevector())


def by_cirq(text: str) -> np.ndarray:
    import cirq
    from cirq.contrib.qasm_import import circuit_from_qasm

    read = circuit_from_qasm(text)
    gates = cirq.Circuit(op for op in read.all_operations() if not cirq.is_measurement(op))
    order = [cirq.NamedQubit(f"q_{i}") for i in range(len(read.all_qubits()))]
    return expectations(
        cirq.Simulator(dtype=np.complex128).simulate(gates, qubit_order=order).final_state_vector
    )


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
@pytest.mark.parametrize(
    ("reader", "format"),
    [(by_qiskit, "qasm3"), (by_qiskit, "qasm2"), (by_pytket, "qasm2"), (by_cirq, "qasm2")],
)
@pytest.mark.parametrize("level", [0, 1, 2])
def test_readers_find_the_policy_s_expectations(
    tmp_path: Path,
    reader: Callable[[str], np.ndarray],
    format: Literal["qasm3", "qasm2"],
    level: int,
) -> None:
    device = qcompile.load_device("ibm_lima")
    folder = tmp_path / "job"
    export_job(POLICY, device, folder, level=level, format=format, observations=OBSERVATIONS)
    found = np.full((3, 24), np.nan)
    for program in json.loads((folder / "job.json").read_text())["programs"]:
        z = reader((folder / program["file"]).read_text())
        if format == "qasm3":  # on physical qubits: bit i is measured on $qubits[i]
            z = z[program["qubits"]]
        found[program["observation"], program["circuits"]] = z
    np.testing.assert_allclose(found, closed_form(), atol=1e-9)
