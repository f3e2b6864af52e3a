"""The placement of circuits on qubits, and the reasons for it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import click

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.noise import REFERENCE_SHOTS, USABLE_CONTRAST, unusable
from qcompile.report.circuit_words import numbers
from qcompile.report.tables import plural, print_table


def perfect_error(shots: int = REFERENCE_SHOTS) -> float:
    """The error of a perfect qubit, shot noise: the mean of 1 - z^2 over z in [-1, 1] is 2/3."""
    return math.sqrt(2 / 3 / shots)


def left_out(device: Device, calibration: Calibration | None = None) -> dict[int, str]:
    """The qubits that are not used, with the reasons; the twin of a calibration has no others."""
    calibrated = range(len(device.qubits)) if calibration is None else calibration.qubits
    return {
        qubit: reason if qubit in calibrated else "was not calibrated"
        for qubit, reason in unusable(device).items()
    }


def print_placement(values: dict[str, Any]) -> None:
    """Print the placement in `executable_values` on a device.

    The most important circuits come first; importance is shown for a policy.
    """
    weighed = "policy" in values
    is_wide = "qubits" in next(iter(values["circuits"]), {})
    of_circuit = ["qubits", "round", "success"] if is_wide else ["qubit", "round", "error of <Z>"]
    print_table(
        ["circuit", *(["importance"] if weighed else []), *of_circuit],
        [
            [
                row["circuit"],
                *([f"{100 * row['importance']:5.1f} %"] if weighed else []),
                *(_wide_cells(row) if is_wide else _cells(row)),
            ]
            for row in sorted(values["circuits"], key=lambda row: -row["importance"])
        ],
        f"Placement on {values['backend']}, in {plural(values['rounds'], 'round')}",
    )
    for line in _lines(values, weighed, is_wide):
        click.echo(line)


def _cells(row: Mapping[str, Any]) -> list[object]:
    error = row["expected_error"]
    return [row["qubit"], row["round"], "unknown" if error is None else f"{error:.4f}"]


def _wide_cells(row: Mapping[str, Any]) -> list[object]:
    qubits, passed = numbers(row["qubits"]), numbers(row["routing_qubits"])
    success = f"{100 * row['estimated_success']:.1f} %"
    return [f"{qubits} (routing: {passed})" if passed else qubits, row["round"], success]


def left_out_words(reasons: Mapping[int, str]) -> str:
    """Which qubits are not used, each with the reason."""
    words = ", ".join(f"{qubit} {reason}" for qubit, reason in reasons.items())
    text = f"unused qubits (at least {USABLE_CONTRAST} of <Z> must be left): {words}"
    return textwrap.fill(text, 80, subsequent_indent="  ")


def _lines(values: dict[str, Any], weighed: bool, is_wide: bool) -> Iterator[str]:
    if weighed:
        yield "importance: variance of a circuit's weights over actions, as a share of all"
    words = (
        "success: the product of 1 - error over the gates, couplings and measurements of a circuit"
        if is_wide
        else f"error of <Z>: root mean square at {REFERENCE_SHOTS} shots, readout mitigated "
        f"({perfect_error():.4f} if perfect)"
    )
    yield textwrap.fill(words, 80, subsequent_indent="  ")
    if values["left_out"]:
        yield left_out_words({row["qubit"]: row["reason"] for row in values["left_out"]})
    rounds, copies = values["rounds"], values["copies_that_fit"]
    if rounds > 1:
        yield f"the device is too small for all circuits at once: they are run in {rounds} rounds"
    elif copies > 1:
        yield f"{copies} copies of the circuits fit on the device at once (--copies)"
    elif not is_wide:
        yield "one copy of the circuits fits on the device"
