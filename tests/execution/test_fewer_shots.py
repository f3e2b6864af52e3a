"""Circuits with fewer shots than a sampler runs: the last shots are ignored."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.primitives import BitArray, DataBin, PubResult

from qcompile.execution import PrimitiveExecutor
from qcompile.passes import compile
from qcompile.policy.layouts import parallel
from qcompile.snapshot import find_backend


class Bits:
    """A sampler whose only ones are those of the last shot, for the PUBs of any job."""

    def __init__(self) -> None:
        self.shots: list[int] = []

    def run(self, pubs: list[tuple[QuantumCircuit, Any]], *, shots: int) -> Any:
        self.shots.append(shots)
        rows = next(len(array) for array in pubs[0][1].values())
        results = []
        for circuit, _ in pubs:
            bits = np.zeros((rows, shots, circuit.num_clbits), dtype=bool)
            bits[:, -1] = True
            register = BitArray.from_bool_array(bits)
            results.append(PubResult(DataBin(c=register, shape=(rows,))))
        return Finished(results)


class Finished:
    def __init__(self, results: list[Any]):
        self.results = results

    def result(self) -> list[Any]:
        return self.results


@pytest.mark.parametrize("circuits", [4, 7])
def test_circuits_with_fewer_shots_leave_out_the_last_ones(circuits: int) -> None:
    """In one round, and in two; a split row asks for this."""
    sampler = Bits()
    executor = PrimitiveExecutor(find_backend("fake_lima"), sampler=sampler)
    executable = compile(parallel(circuits, 1)[0], executor.device)
    x, theta = np.zeros((3, circuits)), np.zeros(circuits)
    shots = np.array([9, 9, 8, 8, 7, 9, 8][:circuits])
    ones = executor.prepare(executable).ones(x, theta, shots)
    assert sampler.shots == [9]
    np.testing.assert_array_equal(ones, np.tile(shots == 9, (3, 1)))
    assert (executor.run(executable, x, theta, 9) == 1).all()
