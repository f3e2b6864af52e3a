"""What a calibration says: as plain values, and as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.report.tables import plural, print_table

FloatArray = NDArray[np.float64]

MISFIT_LEVEL = 0.001
"""A fit that is right is flagged this often."""


def calibration_values(calibration: Calibration) -> dict[str, Any]:
    """The plain values of `qcompile calibrate --json`, without the counts."""
    counts = calibration.readout_counts or calibration.response_counts
    shots = None if counts is None else counts.shots
    rows: list[dict[str, Any]] = [{"qubit": qubit} for qubit in calibration.qubits]
    readout, response = calibration.readout, calibration.response
    if readout is not None:
        names = ("p10", "p10_error", "p01", "p01_error")
        _add(rows, {name: getattr(readout, name) for name in names})
        _add(rows, _fit("readout", readout.chi_square, readout.degrees_of_freedom, shots))
    if response is not None:
        _add(rows, _response(calibration))
        _add(rows, _fit("response", response.chi_square, response.degrees_of_freedom, shots))
    return {
        "backend": calibration.backend,
        "kind": calibration.kind,
        "created": calibration.created.isoformat(),
        "shots": shots or "exact",
        "executions": calibration.executions,
        "qubits": rows,
    }


def _add(rows: list[dict[str, Any]], columns: Mapping[str, Sequence[Any]]) -> None:
    for name, column in columns.items():
        for row, value in zip(rows, column, strict=True):
            row[name] = value


def _fit(part: str, chi_square: Sequence[float], degrees: int, shots: int | None) -> dict[str, Any]:
    """Chi-square, degrees of freedom and p-value of a fit; None where there is no scatter."""
    count = len(chi_square)
    if shots is None or not degrees:
        return {f"{part}_{name}": [None] * count for name in ("chi_square", "degrees", "p_value")}
    from scipy.stats import chi2

    return {
        f"{part}_chi_square": chi_square,
        f"{part}_degrees": [degrees] * count,
        f"{part}_p_value": chi2.sf(chi_square, degrees).tolist(),
    }


def _response(calibration: Calibration) -> dict[str, list[float]]:
    """Offset, contrast and tilt of every qubit in the ideal polar angle, with standard errors."""
    assert calibration.response is not None
    sign = 1.0 if "rx" in calibration.device.basis_gates else -1.0
    b, c, s = np.array(calibration.response.curves).T
    covariance = np.array(calibration.response.covariance)
    contrast, tilt = np.hypot(c, s), np.arctan2(sign * s, sign * c)
    along = np.stack([c, s], axis=1) / contrast[:, None]
    across = np.stack([-s, c], axis=1) / contrast[:, None] ** 2
    inner = covariance[:, 1:, 1:]
    return {
        "offset": b.tolist(),
        "offset_error": np.sqrt(covariance[:, 0, 0]).tolist(),
        "contrast": contrast.tolist(),
        "contrast_error": _root(np.einsum("qi,qij,qj->q", along, inner, along)),
        "tilt_rad": tilt.tolist(),
        "tilt_error_rad": _root(np.einsum("qi,qij,qj->q", across, inner, across)),
    }


def _root(variance: FloatArray) -> list[float]:
    """Standard errors: a variance that is nothing may be rounded below 0."""
    return [float(error) for error in np.sqrt(np.maximum(variance, 0.0))]


def misfits(values: dict[str, Any]) -> Iterator[str]:
    """A sentence for each fit whose p-value lies below MISFIT_LEVEL."""
    words = {
        "readout": "its readout depends on what the other qubits hold, or drifted meanwhile",
        "response": "its response is no curve b + c cos(a) + s sin(a), or drifted meanwhile",
    }
    for row in values["qubits"]:
        for part, why in words.items():
            p_value = row.get(f"{part}_p_value")
            if p_value is not None and p_value < MISFIT_LEVEL:
                found, degrees = row[f"{part}_chi_square"], row[f"{part}_degrees"]
                yield (
                    f"qubit {row['qubit']}: {why} "
                    f"(chi-square {found:.1f} for {degrees}, p-value {p_value:.0e})"
                )


def print_calibration(values: dict[str, Any]) -> None:
    """Print the table of `calibration_values`; a fit has its chi-square of its expectation."""
    first = values["qubits"][0]
    columns = ["qubit"]
    if "p10" in first:
        columns += ["p10 %", "p01 %"]
    if "offset" in first:
        columns += ["offset", "contrast", "tilt, mrad"]
    columns += [f"{part} fit" for part in ("readout", "response") if f"{part}_degrees" in first]
    print_table(
        columns,
        [list(_cells(row)) for row in values["qubits"]],
        f"{values['backend']}: "
        + (
            "exact probabilities"
            if values["shots"] == "exact"
            else f"{plural(values['shots'], 'shot')} of each circuit, "
            f"{values['executions']:,} executions"
        ),
        tight=True,
    )


def _cells(row: dict[str, Any]) -> Iterator[object]:
    yield row["qubit"]
    for name in ("p10", "p01"):
        if name in row:
            error = 100 * row[f"{name}_error"]
            places = 2 if error < 1 else 1
            yield f"{100 * row[name]:.{places}f}±{error:.{places}f}"
    if "offset" in row:
        yield f"{row['offset']:+.4f}"
        yield f"{row['contrast']:.4f}"
        yield f"{1e3 * row['tilt_rad']:+.0f}±{1e3 * row['tilt_error_rad']:.0f}"
    for part in ("readout", "response"):
        if f"{part}_degrees" in row:
            degrees, p_value = row[f"{part}_degrees"], row[f"{part}_p_value"]
            flag = " bad" if p_value is not None and p_value < MISFIT_LEVEL else ""
            yield f"{row[f'{part}_chi_square']:.0f} of {degrees}{flag}" if degrees else "-"


def is_misfit(row: dict[str, Any]) -> bool:
    """Whether a fit of this qubit is flagged."""
    found = [row.get(f"{part}_p_value") for part in ("readout", "response")]
    return any(p is not None and p < MISFIT_LEVEL for p in found)
