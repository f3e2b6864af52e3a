"""Measuring the readout and the response of a device's qubits, and fitting them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration, ReadoutCounts, ResponseCounts
from qcompile.device import Device
from qcompile.errors import CalibrationError
from qcompile.execution.cost import Workload
from qcompile.execution.executor import Executor
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.limits import MAX_QUBITS
from qcompile.mitigation.fits import fit_readout, fit_response
from qcompile.mitigation.orders import angle_orders
from qcompile.passes import Executable, compile

Part = Literal["readout", "response"]
PARTS: tuple[Part, ...] = get_args(Part)
"""The parts of a calibration, in the order in which they are measured."""

CALIBRATION_SHOTS = 8192
RESPONSE_ANGLES_RAD = np.pi / 4 * np.array([0, 4, 0, 4, 1, 3, 5, 7])
"""Twice at each pole, where shot noise is least and contrast shows, and four other angles."""
LIVE_ANGLES_RAD = RESPONSE_ANGLES_RAD[2:]
"""Each angle once, because a machine is paid per circuit."""
_NOTHING = np.zeros((1, 0)), np.zeros(0)


def calibrate(
    executor: Executor,
    qubits: Sequence[int] | IntArray,
    shots: int | None = CALIBRATION_SHOTS,
    *,
    parts: Sequence[Part] = PARTS,
    angles_rad: FloatArray = RESPONSE_ANGLES_RAD,
    on_circuit: Callable[[int, int], None] = lambda done, of: None,
) -> Calibration:
    """Run the calibration circuits on `qubits`, `shots` each, and fit.

    Readout: every qubit is prepared in |0> and |1> in `patterns`, all in one call of the executor;
    the noise of the gate that prepares |1> counts as readout error. Response: sx rz(a) sx (rx(a)
    where it is native) at `angles_rad`, in another call. These are (angles,), which each qubit gets
    in a different order, or (circuits, qubits), used as they are for the sorted qubits. If `shots`
    is None, exact probabilities are fitted. Counts that cannot be fitted are kept, and `unfitted`
    says why. `on_circuit` is called with the number of finished circuits and their total.

    Raises:
        CalibrationError: there is no qubit, or one that the device does not have.
        CountsError: shots are out of range.
    """
    qubits = check_qubits(executor.device, qubits)
    angles_rad = angle_orders(angles_rad, qubits) if angles_rad.ndim == 1 else angles_rad
    prepared = patterns(len(qubits))
    of = len(prepared) * ("readout" in parts) + len(angles_rad) * ("response" in parts)
    readout_counts = response_counts = None
    if "readout" in parts:
        on_circuit(0, of)
        executable = _readout_circuits(prepared, qubits, executor.device)
        ones = _ones(executor, executable, None, shots).reshape(prepared.shape)
        readout_counts = ReadoutCounts(
            prepared=_nested_tuples(prepared), ones=_nested_tuples(ones), shots=shots
        )
    if "response" in parts:
        on_circuit(of - len(angles_rad), of)
        orders, order_of = np.unique(angles_rad, axis=1, return_inverse=True)
        ones = _ones(
            executor, _response_circuits(qubits, executor.device, order_of.ravel()), orders, shots
        )
        response_counts = ResponseCounts(
            angles_rad=_nested_tuples(angles_rad), ones=_nested_tuples(ones), shots=shots
        )
    on_circuit(of, of)
    return fit_counts(
        Calibration(
            backend=executor.device.name,
            kind=executor.kind,
            created=datetime.now(UTC).replace(microsecond=0),
            device=executor.device,
            qubits=tuple(qubits.tolist()),
            readout_counts=readout_counts,
            response_counts=response_counts,
        )
    )


def check_qubits(device: Device, qubits: Sequence[int] | IntArray) -> IntArray:
    """The qubits, sorted, without repetitions.

    Raises:
        CalibrationError: there is no qubit, or one that the device does not have.
    """
    known = len(device.qubits)
    for qubit in qubits:
        if not isinstance(qubit, int | np.integer) or not 0 <= qubit < (known or MAX_QUBITS):
            raise CalibrationError(
                f"{device.name} has no qubit {qubit}.",
                f"Its qubits are 0 to {(known or MAX_QUBITS) - 1}.",
            )
    numbers: IntArray = np.unique(np.asarray(qubits, dtype=np.intp))
    if not numbers.size:
        raise CalibrationError(
            "There is no qubit to calibrate.",
            f"Its qubits are 0 to {known - 1}." if known else "Give at least one.",
        )
    return numbers


def fit_counts(counted: Calibration, qubits: Sequence[int] | None = None) -> Calibration:
    """The calibration with new fits of its counts, on all its qubits or only on `qubits`.

    Raises:
        CalibrationError: a qubit has no counts.
    """
    wanted = sorted(counted.qubits if qubits is None else set(qubits))
    rows = counted.rows(np.array(wanted, dtype=np.intp))
    numbers, unfitted = np.array(wanted), list[str]()
    readout_counts, response_counts = counted.readout_counts, counted.response_counts
    readout = response = None
    if readout_counts is not None:
        prepared = np.array(readout_counts.prepared)[:, rows]
        ones = np.array(readout_counts.ones)[:, rows]
        with _recorded_failure(unfitted):
            readout = fit_readout(prepared, ones, readout_counts.shots, numbers)
        readout_counts = ReadoutCounts(
            prepared=_nested_tuples(prepared), ones=_nested_tuples(ones), shots=readout_counts.shots
        )
    if response_counts is not None:
        angles, ones = response_counts.angles[:, rows], np.array(response_counts.ones)[:, rows]
        with _recorded_failure(unfitted):
            response = fit_response(angles, ones, response_counts.shots, numbers)
        response_counts = ResponseCounts(
            angles_rad=_nested_tuples(angles),
            ones=_nested_tuples(ones),
            shots=response_counts.shots,
        )
    return counted.model_copy(
        update={
            "qubits": tuple(wanted),
            "readout_counts": readout_counts,
            "readout": readout,
            "response_counts": response_counts,
            "response": response,
            "unfitted": tuple(unfitted),
        }
    )


def calibration_workload(
    qubits: int, shots: int, parts: Sequence[Part], angles: int = len(RESPONSE_ANGLES_RAD)
) -> Workload:
    """The jobs and executions of `calibrate` on a number of qubits: one job for each part."""
    load = Workload()
    if "readout" in parts:
        load += Workload.of_batch(1, len(patterns(qubits)), shots)
    if "response" in parts:
        load += Workload.of_batch(angles, 1, shots)
    return load


@contextmanager
def _recorded_failure(unfitted: list[str]) -> Iterator[None]:
    """Adds the message of a failed fit to `unfitted`: its counts may have been paid for."""
    try:
        yield
    except CalibrationError as error:
        unfitted.append(" ".join(str(error).split()))


def patterns(qubits: int) -> IntArray:
    """The bits that qubits are prepared in, (patterns, qubits): all 0, all 1, and balanced ones.

    Bit k of a qubit's index and its opposite give two patterns, for ceil(log2(qubits)) bits. Each
    qubit is 0 as often as 1, and any two qubits differ in some pattern.
    """
    number = np.arange(qubits)
    rows = [np.zeros_like(number), np.ones_like(number)]
    for k in range((qubits - 1).bit_length()):
        bit = number >> k & 1
        rows += [bit, 1 - bit]
    return np.array(rows)


def _ones(
    executor: Executor, executable: Executable, turns: FloatArray | None, shots: int | None
) -> FloatArray:
    """Ones (rows, qubits), or probabilities without shots, for one row or for angles (rows, n)."""
    x, theta = _NOTHING if turns is None else (turns, _NOTHING[1])
    if shots is None:
        return np.asarray((1.0 - executor.expectation(executable, x, theta)) / 2.0)
    return executor.run(executable, x, theta, shots).astype(np.float64)


def _readout_circuits(prepared: IntArray, qubits: IntArray, device: Device) -> Executable:
    """Prepares |0> or |1> on each of `qubits`, in native gates; each pattern is a round."""
    circuits = tuple(Circuit((Gate("x"),)) if bit else Circuit() for bit in prepared.flat)
    rounds = np.repeat(np.arange(len(prepared)), len(qubits))
    compiled = compile(Program(circuits), device, level=1)
    return replace(compiled, qubits=np.tile(qubits, len(prepared)), rounds=rounds)


def _response_circuits(qubits: IntArray, device: Device, order_of: IntArray) -> Executable:
    """The response circuit on each of `qubits`; `order_of` has the index of its input a."""
    inputs = tuple(f"x{order}" for order in range(order_of.max() + 1))
    circuits = tuple(device.native.response_circuit(Angle.symbol(inputs[i])) for i in order_of)
    program = Program(circuits, inputs)
    return Executable(program, program, device, 2, qubits, np.zeros_like(qubits))


def _nested_tuples(array: NDArray[Any]) -> tuple[tuple[Any, ...], ...]:
    return tuple(map(tuple, array.tolist()))
