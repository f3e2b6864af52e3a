"""A user's PUBs for the tests of the sampler, and the results of IBM's own sampler."""

from __future__ import annotations

from typing import Any

import numpy as np
from qiskit import ClassicalRegister, QuantumCircuit, QuantumRegister
from qiskit.circuit import Parameter

VALUES = np.linspace(0.1, 3.0, 12).reshape(2, 3, 2)


def two_registers() -> QuantumCircuit:
    """Two parameters whose names are in another order than their gates, and two registers.

    The second register reads a qubit that is turned by "a", one that is not touched, and has a bit
    that is never written.
    """
    first, second = Parameter("b"), Parameter("a")
    made = QuantumCircuit(
        QuantumRegister(5, "q"), ClassicalRegister(1, "left"), ClassicalRegister(3, "right")
    )
    for qubit, parameter in ((0, first), (2, second)):
        made.sx(qubit)
        made.rz(parameter, qubit)
        made.sx(qubit)
    made.measure([0, 2, 1], [0, 1, 3])
    return made


def flipped(qubit: int = 3) -> QuantumCircuit:
    """One qubit of five is flipped; all are measured."""
    made = QuantumCircuit(5)
    made.x(qubit)
    made.measure_all()
    return made


def bits(result: Any) -> list[dict[str, list[Any]]]:
    """The packed bits of every PUB and register of a result."""
    return [{name: pub.data[name].array.tolist() for name in pub.data} for pub in result]


def by_ibm(backend: str, pubs: list[Any], shots: int) -> Any:
    """The result of qiskit-ibm-runtime's own sampler, without the guard."""
    from qiskit_ibm_runtime import QiskitRuntimeService
    from qiskit_ibm_runtime.executor_sampler import Sampler

    machine = QiskitRuntimeService().backend(backend)
    return Sampler(mode=machine).run(pubs, shots=shots).result()
