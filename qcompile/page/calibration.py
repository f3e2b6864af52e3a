"""The report of a calibration."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from qcompile.calibration import Calibration
from qcompile.page.document import (
    Block,
    Document,
    Facts,
    Picture,
    Qubits,
    Score,
    Section,
    Table,
    Tile,
)
from qcompile.page.words import without_folders
from qcompile.report.calibration_values import calibration_table, fit_words, limit_words
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.summary import kind_words
from qcompile.report.tables import plural

_PACKAGES = ("numpy", "scipy", "cvxpy", "qiskit", "qiskit-aer", "qiskit-ibm-runtime")

_WARM = 0.1
"""A readout error of that much has the full colour."""


def calibration_document(
    calibration: Calibration,
    values: Mapping[str, Any],
    draw: Callable[[AnyStyle], Figure],
    *,
    warnings: Sequence[str] = (),
    command: str = "",
) -> Document:
    """The report of a calibration; `values` are those of `qcompile calibrate --json`."""
    bad = len({misfit["qubit"] for misfit in values["calibration_misfits"]})
    return Document(
        "calibrate",
        f"Calibration of {calibration.backend}",
        f"{plural(len(calibration.qubits), 'qubit')} of {calibration.backend} "
        f"({kind_words(calibration.kind)}), measured {calibration.created:%Y-%m-%d %H:%M} UTC.",
        _score(values),
        [
            ("qubits", str(len(calibration.qubits))),
            *_averages(values),
            ("shots per circuit", _number(values["shots"])),
            ("executions", f"{calibration.executions:,}"),
            ("qubits with a bad fit", str(bad)),
        ],
        [
            Section("Check", [*_check(values)]),
            Section("Curves and errors", [_figure(calibration, draw)]),
            Section("Qubits", [*_qubits(calibration, values)]),
            Section("Settings", [Facts([*_settings(calibration, values)])]),
        ],
        warnings,
        _PACKAGES,
        command=command,
    )


def _number(shots: Any) -> str:
    return f"{shots:,}" if isinstance(shots, int) else str(shots)


def _each(shots: int | None) -> str:
    return "exact" if shots is None else f"{_number(shots)} shots each"


def _readout_errors(values: Mapping[str, Any]) -> list[float]:
    """The mean of p10 and p01 of each qubit; empty where the readout was not fitted."""
    return [(row["p10"] + row["p01"]) / 2 for row in values["qubits"] if "p10" in row]


def _contrasts(values: Mapping[str, Any]) -> list[float]:
    return [row["contrast"] for row in values["qubits"] if "contrast" in row]


def _score(values: Mapping[str, Any]) -> Score | None:
    if errors := _readout_errors(values):
        low, high = 100 * min(errors), 100 * max(errors)
        return Score(
            "median readout error",
            f"{100 * statistics.median(errors):.2f}",
            "%",
            f"from {low:.2f} % to {high:.2f} %, the mean of p10 and p01 of each qubit",
        )
    if contrasts := _contrasts(values):
        low, high = min(contrasts), max(contrasts)
        words = f"from {low:.4f} to {high:.4f}"
        return Score("median contrast", f"{statistics.median(contrasts):.4f}", interval=words)
    return None


def _averages(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if _readout_errors(values) and (contrasts := _contrasts(values)):
        yield "median contrast", f"{statistics.median(contrasts):.4f}"


def _figure(calibration: Calibration, draw: Callable[[AnyStyle], Figure]) -> Picture:
    parts = [
        *["response curves"] * (calibration.response is not None),
        *["readout errors"] * (calibration.readout is not None),
    ]
    label = " and ".join(parts).capitalize() or "Counts"
    return Picture.of(label, draw, "The table below has the numbers that were fitted.")


def _qubits(calibration: Calibration, values: Mapping[str, Any]) -> Iterator[Block]:
    table = calibration_table(dict(values))
    bad = {misfit["qubit"] for misfit in values["calibration_misfits"]}
    marked = frozenset(i for i, qubit in enumerate(calibration.qubits) if qubit in bad)
    words = [
        *["p10: a 0 that is read as 1. p01: a 1 that is read as 0."]
        * bool(errors := _readout_errors(values))
    ]
    if _contrasts(values):
        words.append(
            "Measured <Z> = offset + contrast cos(w - tilt), where cos(w) is <Z> without errors."
        )
    words += [f"{line[0].upper()}{line[1:]}." for line in fit_words(values)]
    words += ["Rows of a bad fit are marked."] * bool(marked)
    if errors:
        tiles = [
            Tile(qubit, f"{100 * error:.2f} %", min(error / _WARM, 1.0), "bad fit" * (qubit in bad))
            for qubit, error in sorted(zip(calibration.qubits, errors, strict=True))
        ]
        yield Qubits("Readout error of each qubit", tiles, "The mean of p10 and p01.")
    yield Table("Fits of each qubit", table.header, table.words, " ".join(words), marked)


def _check(values: Mapping[str, Any]) -> Iterator[Block]:
    check = values.get("check")
    if check is None:
        return
    yield Facts(
        [
            ("compared with", without_folders(check["file"])),
            ("its age", f"{check['age_hours']:.1f} hours"),
            ("drifted qubits", ", ".join(map(str, check["drifted"])) or "none"),
        ]
    )
    yield Table(
        "Fresh counts against the older calibration",
        ["qubit", f"chi-square of {check['degrees']}", "p-value"],
        [
            [str(row["qubit"]), f"{chi_square:.1f}", f"{p_value:.2g}"]
            for row, chi_square, p_value in zip(
                values["qubits"], check["chi_square"], check["p_value"], strict=True
            )
        ],
        limit_words(len(values["qubits"])),
        marked=frozenset(
            i for i, row in enumerate(values["qubits"]) if row["qubit"] in check["drifted"]
        ),
    )


def _settings(calibration: Calibration, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    device = calibration.device
    yield "backend", calibration.backend
    yield "native gates", " ".join(device.native.gates)
    counts = {"readout": calibration.readout_counts, "response": calibration.response_counts}
    for part, counted in counts.items():
        if counted is not None:
            yield (
                f"{part} circuits",
                f"{len(counted.ones)} circuits, {_each(counted.shots)}",
            )
    yield "device", device.source
    if values.get("file"):
        yield "file", without_folders(values["file"])
    if "run" in values:
        yield "run", str(values["run"])
