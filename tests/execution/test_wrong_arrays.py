"""Invalid arrays, shots and programs are refused with a message."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.errors import CircuitError, CountsError, PolicyError

DEVICE = qcompile.load_device("ibm_lima")
POLICY = qcompile.load_policy("cartpole")
X = np.zeros((2, 4))
THETA = np.zeros(0)


@pytest.fixture(scope="module")
def executable() -> qcompile.Executable:
    return qcompile.compile(POLICY.trained_program, DEVICE)


@pytest.mark.parametrize(
    "x",
    [
        None,
        [[0.0] * 4],
        X.astype(complex),
        X.astype(object),
        X.astype("U3"),
        X.astype("datetime64[s]"),
        np.ma.masked_all((2, 4)),
    ],
)
def test_inputs_are_arrays_of_real_numbers(x: Any, executable: qcompile.Executable) -> None:
    with pytest.raises(CircuitError, match="x has"):
        executable.bind(x, THETA)


@pytest.mark.parametrize("shots", [None, True, 1.5, "8", 0, 2**64, [8], np.array([8])])
def test_shots_are_a_whole_number(shots: Any, executable: qcompile.Executable) -> None:
    with pytest.raises(CountsError, match="shots cannot be run"):
        qcompile.OfflineExecutor(DEVICE).run(executable, X, THETA, shots)
    with pytest.raises(CountsError, match="shots cannot be run"):
        qcompile.expectation_from_ones(np.array([1]), shots)


@pytest.mark.parametrize("ones", [[1.5], [np.inf], [1j], ["1"], [None], [[1], [2, 3]]])
def test_counts_are_integers(ones: Any) -> None:
    with pytest.raises(CountsError):
        qcompile.expectation_from_ones(ones, 8)


@pytest.mark.parametrize("observations", ["x", None, [["a"] * 4], [[1j] * 4], [[0], [0, 1]]])
def test_observations_are_real_numbers(observations: Any) -> None:
    with pytest.raises(PolicyError, match="not an array of real numbers"):
        POLICY.encode(observations)


@pytest.mark.parametrize("copies", [0, 2**40, 1.5, None, "2"])
def test_copies_are_a_number_that_can_be_placed(copies: Any) -> None:
    with pytest.raises(CircuitError, match="copies"):
        qcompile.compile(POLICY.trained_program, DEVICE, copies=copies)


@pytest.mark.parametrize("level", [[2], {}, np.array(2), 3, "2", None])
def test_levels_are_numbers(level: Any) -> None:
    with pytest.raises(CircuitError, match="no level"):
        qcompile.compile(POLICY.trained_program, DEVICE, level)


@pytest.mark.parametrize("source", [0, None, 1.5, [1]])
def test_a_number_is_no_file_of_openqasm(source: Any) -> None:
    """A number would be an open file: 0 is the standard input, which may never end."""
    with pytest.raises(CircuitError, match="takes OpenQASM text or a path"):
        qcompile.Program.from_qasm(source)


def test_a_policy_is_saved_to_a_path() -> None:
    with pytest.raises(PolicyError, match="takes a Policy or a Network, and a path"):
        qcompile.save_policy(POLICY, None)  # type: ignore[arg-type]
    with pytest.raises(PolicyError, match="takes a Policy or a Network, and a path"):
        qcompile.save_policy("cartpole", "a.json")  # type: ignore[arg-type]
