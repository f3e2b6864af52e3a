"""Angles, expectations, counts and mitigated values are those of version 0.1.0.

values_of_0_1_0.json was written by the code of that version. On the processor that wrote it the
numbers are the same bit for bit; cosines of others may differ in the last digit.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.device import Device, GateCalibration, Qubit
from qcompile.execution import OfflineExecutor, TwinExecutor
from qcompile.ir import Circuit, Program
from qcompile.mitigation import (
    calibrate,
    predistorted,
    readout_mitigation,
    response_mitigation,
)
from qcompile.passes import compile

VALUES: dict[str, dict[str, Any]] = json.loads(
    (Path(__file__).parent / "values_of_0_1_0.json").read_text()
)
TEXTS = (
    "h ry(x0) rz(x0) ry(theta0)",
    "",
    "ry(0.3) rz(x1) ry(x0-x1)",
    "x",
    "rz(x1) h rz(0.5*x0+theta0) h",
)
X, THETA = np.array([[0.3, -1.2, 0.4, -1.0], [2.0, 0.7, 2.1, 0.9]]), np.array([0.4])


def three_qubits(basis: tuple[str, ...]) -> Device:
    def qubit(q: int) -> Qubit:
        gate = GateCalibration(error=0.002 * (q + 1), length_ns=40.0 * (q + 1))
        gates = {name: gate for name in basis if name != "rz"}
        return Qubit(t1_us=60 + 20 * q, t2_us=50 + 40 * q, p10=0.01 * q, p01=0.02, gates=gates)

    qubits = tuple(map(qubit, range(3)))
    return Device(name="three", source="by hand", basis_gates=basis, qubits=qubits)


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("basis", [("rz", "sx", "x"), ("rz", "rx")])
def test_values_are_those_of_version_0_1_0(basis: tuple[str, ...], level: int) -> None:
    """Two copies of five circuits on three qubits: four rounds, and circuits without rotations."""
    device = three_qubits(basis)
    program = Program.of(map(Circuit.parse, TEXTS), 2, 1)
    executable = compile(program, device, level, copies=2)
    calibration = calibrate(OfflineExecutor(device), np.arange(3), None)
    executor = OfflineExecutor(device, 7)
    z = executor.expectation(executable, X, THETA)
    found = {
        "angles": executable.bind(X, THETA),
        "expectation": z,
        "ones": executor.run(executable, X, THETA, 1000),
        "readout": readout_mitigation(calibration, executable).apply(z),
    }
    if level == 2:
        twin = TwinExecutor(calibration, 7)
        found |= {
            "response": response_mitigation(calibration, executable).apply(z),
            "predistorted": executor.expectation(predistorted(executable, calibration), X, THETA),
            "twin": twin.expectation(executable, X, THETA),
            "twin ones": twin.run(executable, X, THETA, 1000),
        }
    wanted = VALUES[f"{' '.join(basis)}, level {level}"]
    assert found.keys() == wanted.keys()
    for name, values in found.items():
        np.testing.assert_allclose(values, wanted[name], rtol=0, atol=4e-15, err_msg=name)
