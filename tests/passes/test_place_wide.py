"""Copies of circuits of several qubits: how many fit, and where they go."""

from __future__ import annotations

import pytest

import qcompile
from qcompile.device import load_device
from qcompile.ir import Circuit, Program
from qcompile.passes import compile, copies_that_fit

LINE = Circuit.parse("ry(x0)@0 cx@0,1 ry(x1)@1 cx@1,2 ry(x0)@2", 3)


def coupling_error(executable: qcompile.Executable, copy: int) -> float:
    """The sum of the errors of a copy's couplings."""
    native, device = executable.native, executable.device
    circuit, first = native.circuits[copy], native.first_bits[copy]
    return sum(
        device.coupling_calibrations[
            (gate.name, *(int(executable.qubits[first + qubit]) for qubit in gate.qubits))
        ].error
        for gate in circuit.gates
        if gate.is_coupling
    )


@pytest.mark.parametrize(("name", "most"), [("fake_lima", 1), ("fake_toronto", 9)])
def test_the_copies_that_fit_share_a_round(name: str, most: int) -> None:
    """No two share a qubit, and none has more than twice the coupling error of the first."""
    program, device = Program.of([LINE], 2), load_device(name)
    fit = copies_that_fit(program, device)
    assert 1 <= fit <= most  # of 25 qubits, in threes
    executable = compile(program, device, copies=fit)
    assert executable.round_count == 1
    assert compile(program, device).copies_that_fit == fit
    assert len(set(executable.qubits.tolist())) == 3 * fit
    errors = [coupling_error(executable, copy) for copy in range(fit)]
    assert max(errors) <= max(2 * errors[0], 0.05)
    assert (fit > 2) == (name == "fake_toronto")


def test_circuits_of_one_qubit_beside_count_too() -> None:
    device = load_device("fake_lima")
    beside = [LINE, Circuit.parse("ry(x0)"), Circuit.parse("ry(x1)")]
    assert copies_that_fit(Program.of(beside, 2), device) == 1
    two = Program.of([Circuit.parse("h@0 cx@0,1", 2)])
    assert copies_that_fit(two, device) == 2
    assert copies_that_fit(Program.of(beside, 2), load_device("ideal")) == 1


def test_more_copies_than_fit_take_rounds() -> None:
    program, device = Program.of([LINE], 2), load_device("fake_lima")
    executable = compile(program, device, copies=3)
    assert sorted(executable.rounds.tolist()) == [0, 1, 2]
