"""What needs circuits of one qubit refuses wider ones by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.errors import CircuitError
from qcompile.execution import TwinExecutor
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate, predistorted, readout_mitigation, response_mitigation
from qcompile.simulate import Simulator

WIDE = Program.of([Circuit.parse("ry(x0)"), Circuit.parse("ry(x1)@0 cz@0,1", 2)], 2)


def executable() -> Any:
    return qcompile.compile(WIDE, qcompile.load_device("fake_lima"))


def known() -> Any:
    return calibrate(qcompile.OfflineExecutor(qcompile.load_device("fake_lima")), range(5), None)


CALLS: dict[str, Callable[[], object]] = {
    "A Simulator": lambda: Simulator(WIDE),
    "A twin": lambda: TwinExecutor(known()).prepare(executable()),
    "Readout mitigation": lambda: readout_mitigation(known(), executable()),
    "Response mitigation": lambda: response_mitigation(known(), executable()),
    "Predistortion": lambda: predistorted(executable(), known()),
}


@pytest.mark.parametrize("purpose", CALLS)
def test_wide_circuits_are_refused_by_name(purpose: str) -> None:
    words = rf"{purpose} needs circuits of one qubit: circuit \d has 2.\n  \w"
    with pytest.raises(CircuitError, match=words):
        CALLS[purpose]()


def test_other_observables_are_refused_too() -> None:
    program = replace(Program.of([Circuit.parse("ry(x0)")] * 2, 1), observables=((1,), (0,)))
    with pytest.raises(CircuitError, match="A Simulator measures each circuit"):
        Simulator(program)
    np.testing.assert_equal(program.measured, ((1,), (0,)))
