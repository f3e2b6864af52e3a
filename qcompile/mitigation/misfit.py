"""Fits that contradict their counts, because of crosstalk or because the device drifted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration, ReadoutFit, ResponseFit
from qcompile.mitigation.measure import PARTS, Part
from qcompile.validation import listed

MISFIT_LEVEL = 0.001
"""The probability that a calibration with correct fits is doubted, for all its fits together."""

_FOUND: dict[Part, str] = {
    "readout": "depends on the state of other qubits",
    "response": "does not depend on its own angle alone",
}
_ADVICE: dict[Part, str] = {
    "readout": "Use other qubits, with an unused one between neighbours.",
    "response": "Use other qubits, with an unused one between neighbours; `calibrate --parts "
    "readout,response` shows whether the readout is the cause.",
}


@dataclass(frozen=True)
class Misfit:
    """A fit of a qubit whose chi-square is too large for a correct fit, at MISFIT_LEVEL."""

    qubit: int
    part: Part
    chi_square: float
    degrees: int
    p_value: float

    def values(self) -> dict[str, Any]:
        """The misfit as plain values."""
        return asdict(self)


def p_values(fit: ReadoutFit | ResponseFit) -> NDArray[np.float64]:
    """How often a correct fit has at least this chi-square, (qubits,); 1 without degrees."""
    if not fit.degrees_of_freedom:
        return np.ones(len(fit.chi_square))
    from scipy.stats import chi2

    return np.asarray(chi2.sf(fit.chi_square, fit.degrees_of_freedom))


def misfits(
    calibration: Calibration, parts: Iterable[Part] = PARTS, qubits: Iterable[int] | None = None
) -> list[Misfit]:
    """The misfits among `parts` of `qubits` (all: None), by part and qubit.

    The level for one fit is MISFIT_LEVEL divided by the number of fits in the calibration
    (Bonferroni). Exact calibrations have no chi-square and so no misfits.
    """
    fits = {"readout": calibration.readout, "response": calibration.response}
    fitted = [fit for fit in fits.values() if fit is not None and fit.degrees_of_freedom]
    level = MISFIT_LEVEL / max(len(fitted) * len(calibration.qubits), 1)
    wanted = set(calibration.qubits if qubits is None else qubits)
    contradicting = []
    for part in sorted(set(parts), key=PARTS.index):
        fit = fits[part]
        if fit is None:
            continue
        p = p_values(fit)
        contradicting += [
            Misfit(
                calibration.qubits[i], part, fit.chi_square[i], fit.degrees_of_freedom, float(p[i])
            )
            for i in np.flatnonzero(p < level)
            if calibration.qubits[i] in wanted
        ]
    return contradicting


def misfit_warnings(misfits: Sequence[Misfit | dict[str, Any]]) -> list[str]:
    """A warning for each part with misfits: the qubits, the likely cause, and what to do."""
    plain = [one.values() if isinstance(one, Misfit) else one for one in misfits]
    lines = []
    for part in PARTS:
        rows = [row for row in plain if row["part"] == part]
        if not rows:
            continue
        worst = min(row["p_value"] for row in rows)
        lines.append(
            f"The {part} of qubit {listed([str(row['qubit']) for row in rows])} {_FOUND[part]}, or "
            f"the device drifted during the measurement (p-value {worst:.0e}). {_ADVICE[part]}"
        )
    return lines
