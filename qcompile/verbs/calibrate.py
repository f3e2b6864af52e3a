"""Measure the readout and the response of a device's qubits: what `qcompile calibrate` does."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration, load_calibration, load_counts
from qcompile.caller import option
from qcompile.device import Device
from qcompile.errors import CalibrationError, OptionError
from qcompile.execution import Backend, Executor, open_executor
from qcompile.limits import CALIBRATION_HOURS
from qcompile.live.measure import CalibrateTask
from qcompile.mitigation import calibrate as measure_qubits
from qcompile.mitigation import fit_counts, measure_drift
from qcompile.mitigation.measure import LIVE_ANGLES_RAD, PARTS, RESPONSE_ANGLES_RAD, Part
from qcompile.mitigation.orders import angle_orders
from qcompile.output import resolved
from qcompile.policy import Policy
from qcompile.report import progress as bars
from qcompile.report.calibration_values import calibration_values
from qcompile.report.live import result_values
from qcompile.report.style import AnyStyle
from qcompile.sweep.arguments import Name, Words, ignore
from qcompile.verbs.arguments import checked
from qcompile.verbs.calibration_request import CalibrationRequest
from qcompile.verbs.calibrations import (
    CalibrationOutputs,
    CalibrationResult,
    DriftCheck,
    comparable,
)
from qcompile.verbs.files import path_of
from qcompile.verbs.live import Live, spend


@checked
def calibrate(
    backend: Name | Device | Calibration | Backend | Executor | Any,
    qubits: Sequence[int] | IntArray | None = None,
    shots: int | None = 8192,
    *,
    policy: Name | Policy | None = None,
    parts: Part | Sequence[Part] | None = None,
    seed: int | None = None,
    live: Live | None = None,
    progress: bool = True,
    on_note: Words = ignore,
) -> Calibration:
    """Measure the readout and the response of a device's qubits, and fit them.

    The backend is a name, a file or an object. `qubits` defaults to all usable qubits; with
    `policy`, the qubits that its circuits measure are measured. Each circuit is run for
    `shots`; None fits exact probabilities. `parts` is "readout", "response" or both, the default.
    The same `seed` draws the same shots.

    With `live` the IBM machine of that name is measured, which costs money: see `Live`. `parts`
    then defaults to "response", or for a policy with circuits of several qubits to "readout", and
    the run is recorded in its journal. `on_note` is called with messages for the user. Counts that
    cannot be fitted are kept: `unfitted` of the calibration says why.

    Raises:
        OptionError: options contradict each other.
        QcompileError: a name, a file or a qubit cannot be used; Ctrl-C.
    """
    request = CalibrationRequest(
        backend, qubits, shots, policy, parts, seed, live, progress, on_note
    )
    result = _measure(request)
    for words in result.calibration.unfitted:
        on_note(words)
    return result.calibration


def calibrate_into(
    request: CalibrationRequest,
    out: Name | None = None,
    *,
    force: bool = False,
    plot: Name | None = None,
    style: AnyStyle = None,
) -> CalibrationResult:
    """Measure as `calibrate` does, and write a file and a figure.

    The file is by default BACKEND-calibration.json; an existing one is overwritten only with
    `force`. `plot` is a .png, .svg or .pdf file drawn in `style`; it is overwritten.

    Raises:
        OutputError: a file already exists, or cannot be written.
        QcompileError: as for `calibrate`; also if a fit fails, with the counts in the file.
    """
    outputs = CalibrationOutputs(path_of(out), force, path_of(plot), style, request.reads)
    return _measure(request, outputs)


def check_calibration(
    old: Name | Calibration,
    request: CalibrationRequest,
    *,
    max_age_hours: float | None = None,
    out: Name | None = None,
    force: bool = False,
    plot: Name | None = None,
    style: AnyStyle = None,
) -> DriftCheck:
    """Measure again, and compare with an older calibration: its qubits and parts by default.

    The older one holds if no qubit drifted and its age is at most `max_age_hours` (24). The new
    calibration is written to `out`, if given.

    Raises:
        CalibrationError: the two cannot be compared.
        QcompileError: as for `calibrate_into`.
    """
    if request.shots is None:
        raise OptionError(f"A check compares counts, so {option('shots')} cannot be exact.")
    if force and out is None:
        raise OptionError(
            f"{option('force')} needs {option('out')}: without it a check writes no file."
        )
    file = None if isinstance(old, Calibration) else Path(old)
    reads = {**request.reads, option("check"): file}
    outputs = CalibrationOutputs(path_of(out), force, path_of(plot), style, reads)
    outputs.check_words()
    request.check_words()
    known = old if isinstance(old, Calibration) else load_calibration(Path(old))
    result = _measure(request, outputs, known)
    drift = measure_drift(known, result.calibration)
    check = {
        "file": f"the calibration of {known.backend}" if file is None else str(file),
        "age_hours": known.age_hours(datetime.now(UTC)),
        "drifted": drift.drifted,
        "degrees": drift.degrees_of_freedom,
        "chi_square": drift.chi_square.tolist(),
        "p_value": drift.p_value.tolist(),
    }
    return DriftCheck(
        result.calibration,
        result.to_dict() | {"check": check},
        result.file,
        max_age_hours=CALIBRATION_HOURS if max_age_hours is None else max_age_hours,
        backend=request.backend if isinstance(request.backend, str) else known.backend,
    )


def refit(
    counted: Name,
    qubits: Sequence[int] | IntArray | None = None,
    *,
    out: Name | None = None,
    force: bool = False,
    plot: Name | None = None,
    style: AnyStyle = None,
) -> CalibrationResult:
    """Fit the counts in a calibration file again, for all its qubits or only for `qubits`.

    Nothing is measured and nothing is spent. Files are written as by `calibrate_into`.

    Raises:
        CalibrationError: the file has no counts, or a fit fails.
        OutputError: a file already exists, or cannot be written.
    """
    file = Path(counted)
    reads = {option("from"): file}
    outputs = CalibrationOutputs(path_of(out), force, path_of(plot), style, reads)
    outputs.check_words()
    counts = load_counts(file)
    outputs = outputs.into(counts.backend)
    outputs.check_files()
    calibration = fit_counts(counts, None if qubits is None else list(qubits))
    return _save(calibration, outputs)


def _measure(
    request: CalibrationRequest,
    outputs: CalibrationOutputs | None = None,
    old: Calibration | None = None,
) -> CalibrationResult:
    """Measure a calibration and write it to the outputs; with `old`, run the same circuits."""
    if old is None:
        request.check_words()
        if outputs is not None:
            outputs.check_words()
    live = request.live
    connection = executor = None
    if live is not None:
        connection = live.connection(request.backend)
        device = connection.device()
    else:
        executor = open_executor(request.backend, request.seed)
        device = executor.device
    qubits = request.qubits_on(device, old)
    angles_rad = angle_orders(RESPONSE_ANGLES_RAD if live is None else LIVE_ANGLES_RAD, qubits)
    parts = request.asked
    if old is not None:
        parts = comparable(old, device, qubits.tolist(), parts)
        if old.response_counts is not None:
            angles_rad = old.response_counts.angles[:, old.rows(qubits)]
    elif outputs is not None:
        outputs = outputs.into(device.name)
    if outputs is not None:
        outputs.check_files()
    if executor is not None:
        calibration = _offline(request, executor, qubits, parts or PARTS, angles_rad)
        return _save(calibration, outputs)
    assert live is not None
    assert connection is not None
    assert request.shots is not None
    out = None if outputs is None else outputs.out
    task = CalibrateTask(
        backend=request.backend,
        device=device,
        qubits=tuple(qubits.tolist()),
        shots=request.shots,
        parts=parts or request.live_parts,
        angles_rad=tuple(map(tuple, angles_rad.tolist())),
        out=None if out is None else str(resolved(out)),
        force=outputs is not None and outputs.force,
        **live.where,
    )
    answer = spend(task, task.load, live, connection, request.on_note)
    if out is not None and str(resolved(out)) != answer["file"]:  # `out` was taken meanwhile
        out = Path(answer["file"])
    calibration = Calibration.model_validate(answer["calibration"])
    return _finish(calibration, result_values("calibrate", answer), out, outputs)


def _offline(
    request: CalibrationRequest,
    executor: Executor,
    qubits: IntArray,
    parts: Sequence[Part],
    angles_rad: FloatArray,
) -> Calibration:
    title = f"calibrate {executor.device.name}"
    try:
        with bars.progress_bar(title, 1, enabled=request.progress) as show:
            return measure_qubits(
                executor,
                qubits,
                request.shots,
                parts=parts,
                angles_rad=angles_rad,
                on_circuit=lambda done, of: show(done / of, f"circuit {done} of {of}"),
            )
    except KeyboardInterrupt:
        raise CalibrationError("Interrupted: nothing was written.") from None


def _save(calibration: Calibration, outputs: CalibrationOutputs | None) -> CalibrationResult:
    """Write the calibration to its file, if there is one."""
    out = None if outputs is None else outputs.out
    if out is not None:
        calibration.save(out)
    values = calibration_values(calibration) | {"file": None if out is None else str(out)}
    return _finish(calibration, values, out, outputs)


def _finish(
    calibration: Calibration,
    values: dict[str, Any],
    file: Path | None,
    outputs: CalibrationOutputs | None,
) -> CalibrationResult:
    """Draw the figure and return the result; with outputs, every fit must have succeeded."""
    if outputs is not None:
        if calibration.unfitted:
            where = "No file was written" if file is None else f"The counts are in {file}"
            raise CalibrationError(f"Some fits failed. {where}.", *calibration.unfitted)
        outputs.draw(calibration, file)
    return CalibrationResult(calibration, values, file)
