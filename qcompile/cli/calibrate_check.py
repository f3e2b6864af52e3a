"""What `qcompile calibrate --check` compares, and what it says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from qcompile.cli.options import PARTS
from qcompile.limits import CLOCK_HOURS

if TYPE_CHECKING:
    from qcompile.calibration import Calibration
    from qcompile.device import Device
    from qcompile.mitigation.measure import Part

MAX_AGE_HOURS = 24.0


def comparable(
    old: Calibration, device: Device, qubits: Sequence[int], asked: tuple[Part, ...] | None
) -> tuple[Part, ...]:
    """The parts to measure; what cannot be compared with `old` is refused before it is measured."""
    import numpy as np

    from qcompile.errors import CalibrationError

    if old.backend != device.name:
        raise CalibrationError(
            f"The calibration is of {old.backend}, the backend is {device.name}.",
            "Compare calibrations of one device.",
        )
    old.rows(np.array(qubits))
    counts = zip(PARTS, (old.readout_counts, old.response_counts), strict=True)
    there = {part: found for part, found in counts if found is not None}
    fits = dict(zip(PARTS, (old.readout, old.response), strict=True))
    parts = asked or tuple(there)
    for part in parts:
        if part not in there:
            raise CalibrationError(
                f"The calibration has no counts of the {part}.",
                f"It has: {', '.join(there) or 'none'}.",
            )
        if fits[part] is None:
            raise CalibrationError(
                f"The calibration has no fit of its {part}: there is nothing to check.",
                *old.unfitted,
                "Calibrate anew, into another file.",
            )
        if there[part].shots is None:
            raise CalibrationError("A calibration without shots has no scatter to compare.")
    return parts


def failures(values: dict[str, Any], max_age_hours: float) -> list[str]:
    """Why the calibration that was checked does not hold; empty where it does."""
    check, lines = values["check"], []
    if check["age_hours"] < -CLOCK_HOURS:
        lines.append(
            f"It is from the future, by {-check['age_hours']:.1f} hours: a clock is wrong."
        )
    if check["age_hours"] > max_age_hours:
        lines.append(f"It is {check['age_hours']:.1f} hours old, more than {max_age_hours:g}.")
    if check["drifted"]:
        rows = zip(values["qubits"], check["chi_square"], strict=True)
        moved = [
            f"{row['qubit']} ({chi_square:.0f})"
            for row, chi_square in rows
            if row["qubit"] in check["drifted"]
        ]
        lines.append(
            f"Drifted: {', '.join(moved)}; in brackets chi-square, {check['degrees']} expected."
        )
    return lines


def comparison(values: dict[str, Any]) -> str:
    check = values["check"]
    drifted = ", ".join(map(str, check["drifted"])) or "none"
    return f"{check['file']} is {check['age_hours']:.1f} hours old; drifted qubits: {drifted}"
