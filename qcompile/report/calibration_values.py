"""What a calibration says: as plain values, and as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click
import numpy as np

from qcompile.calibration import Calibration, ReadoutFit, ResponseFit
from qcompile.mitigation.drift import DRIFT_LEVEL
from qcompile.mitigation.measure import PARTS
from qcompile.mitigation.misfit import misfits, p_values
from qcompile.mitigation.polar import polar_curves
from qcompile.report.table import Cell, Column, Table
from qcompile.report.tables import plural, print_table


def calibration_values(calibration: Calibration) -> dict[str, Any]:
    """The plain values of `qcompile calibrate --json`, without the counts."""
    counts = calibration.readout_counts or calibration.response_counts
    shots = None if counts is None else counts.shots
    rows: list[dict[str, Any]] = [{"qubit": qubit} for qubit in calibration.qubits]
    readout, response = calibration.readout, calibration.response
    if readout is not None:
        names = ("p10", "p10_error", "p01", "p01_error")
        _add(rows, {name: getattr(readout, name) for name in names})
        _add(rows, _fit("readout", readout, shots))
    if response is not None:
        _add(rows, _response(calibration))
        _add(rows, _fit("response", response, shots))
    return {
        "backend": calibration.backend,
        "kind": calibration.kind,
        "created": calibration.created.isoformat(),
        "shots": shots or "exact",
        "executions": calibration.executions,
        "qubits": rows,
        "calibration_misfits": [misfit.values() for misfit in misfits(calibration)],
    }


def _add(rows: list[dict[str, Any]], columns: Mapping[str, Sequence[Any]]) -> None:
    for name, column in columns.items():
        for row, value in zip(rows, column, strict=True):
            row[name] = value


def _fit(part: str, fit: ReadoutFit | ResponseFit, shots: int | None) -> dict[str, Any]:
    """Chi-square, degrees of freedom and p-value of a fit; None where there is no scatter."""
    count, degrees = len(fit.chi_square), fit.degrees_of_freedom
    if shots is None or not degrees:
        return {f"{part}_{name}": [None] * count for name in ("chi_square", "degrees", "p_value")}
    return {
        f"{part}_chi_square": fit.chi_square,
        f"{part}_degrees": [degrees] * count,
        f"{part}_p_value": p_values(fit).tolist(),
    }


def _response(calibration: Calibration) -> dict[str, list[float]]:
    """Offset, contrast and tilt of every qubit in the ideal polar angle, with standard errors."""
    assert calibration.response is not None
    curves = polar_curves(calibration.response, calibration.device.native)
    variances = np.diagonal(curves.covariance, axis1=1, axis2=2)
    errors = np.sqrt(np.maximum(variances, 0.0))  # one that is nothing may be rounded below 0
    return {
        "offset": curves.offset.tolist(),
        "offset_error": errors[:, 0].tolist(),
        "contrast": curves.contrast.tolist(),
        "contrast_error": errors[:, 1].tolist(),
        "tilt_rad": curves.tilt.tolist(),
        "tilt_error_rad": errors[:, 2].tolist(),
    }


def calibration_table(values: dict[str, Any], notes: Sequence[str] = ()) -> Table:
    """The qubits of `calibration_values`; a fit has its chi-square of its expectation."""
    first = values["qubits"][0]
    columns = [Column("qubit")]
    if "p10" in first:
        columns += [_with_error("p10 %"), _with_error("p01 %")]
    if "offset" in first:
        offset, contrast, tilt = map(_with_error, ("offset", "contrast", "tilt, mrad"))
        columns += [offset, contrast, tilt]
    for part in PARTS:
        if f"{part}_degrees" in first:
            parts = (f"{part} chi-square", f"{part} expected", f"{part} fit")
            columns.append(Column(f"{part} fit", parts=parts))
    bad = bad_fits(values)
    rows = [list(_cells(row, bad)) for row in values["qubits"]]
    return Table(columns, rows, calibration_title(values), [*notes, *fit_words(values)])


def fit_words(values: Mapping[str, Any]) -> list[str]:
    """What the columns of fits say; nothing where none has a chi-square."""
    first = values["qubits"][0]
    fits = [f"{part} fit" for part in PARTS if first.get(f"{part}_degrees")]
    return [f"{', '.join(fits)}: chi-square, then its expected value"] * bool(fits)


def limit_words(qubits: int) -> str:
    """Where the p-value of one of this many qubits contradicts a calibration."""
    return (
        f"The p-value must be at least {DRIFT_LEVEL / qubits:.2g}: by chance, "
        f"{'one of ' * (qubits > 1)}{plural(qubits, 'qubit')} is below it with a probability of "
        f"{DRIFT_LEVEL:g}."
    )


def _with_error(name: str) -> Column:
    return Column(name, parts=(name, f"{name}, error"))


def calibration_title(values: dict[str, Any]) -> str:
    """Of which device it is, and how many shots it took."""
    if values["shots"] == "exact":
        return f"{values['backend']}: exact probabilities"
    shots = plural(values["shots"], "shot")
    return f"{values['backend']}: {shots} of each circuit, {values['executions']:,} executions"


def calibration_html(calibration: Calibration) -> str:
    """The table of a calibration in HTML."""
    return calibration_table(calibration_values(calibration))._repr_html_()


def print_calibration(values: dict[str, Any]) -> None:
    """Print the table of `calibration_values`."""
    table = calibration_table(values)
    print_table(table.header, table.words, table.title, tight=True, right=(0,))
    for line in fit_words(values):
        click.echo(line)


def _cells(row: dict[str, Any], bad: set[tuple[int, str]]) -> Iterator[Cell]:
    yield Cell.of(row["qubit"])
    for name in ("p10", "p01"):
        if name in row:
            value, error = 100 * row[name], 100 * row[f"{name}_error"]
            places = 2 if error < 1 else 1
            yield Cell(f"{value:.{places}f}±{error:.{places}f}", (value, error))
    if "offset" in row:
        yield Cell(f"{row['offset']:+.4f}", (row["offset"], row["offset_error"]))
        yield Cell(f"{row['contrast']:.4f}", (row["contrast"], row["contrast_error"]))
        tilt, error = 1e3 * row["tilt_rad"], 1e3 * row["tilt_error_rad"]
        yield Cell(f"{tilt:+.0f}±{error:.0f}", (tilt, error))
    for part in PARTS:
        if f"{part}_degrees" in row:
            chi_square, degrees = row[f"{part}_chi_square"], row[f"{part}_degrees"]
            flag = "bad" if (row["qubit"], part) in bad else ""
            words = f"{chi_square:.0f} of {degrees} {flag}".rstrip() if degrees else "-"
            yield Cell(words, (chi_square, degrees, flag or None))


def bad_fits(values: dict[str, Any]) -> set[tuple[int, str]]:
    """Qubit and part of every fit that is flagged."""
    return {(misfit["qubit"], misfit["part"]) for misfit in values["calibration_misfits"]}
