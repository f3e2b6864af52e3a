"""Undoing the effect of a qubit on `<Z>`, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CircuitShots, FloatArray
from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.errors import CalibrationError
from qcompile.mitigation.misfit import misfits
from qcompile.mitigation.polar import polar_curves
from qcompile.passes import Executable
from qcompile.validation import listed

MAX_TILT_RAD = 0.25
"""Near a pole, `<Z>` values up to 2 sin(tilt)^2 apart are indistinguishable: 0.12 at this tilt."""
_MAX_DOUBTFUL_RAD = math.pi / 4
"""Crosstalk can look like a tilt. The tilt of a misfit is not corrected; this is its largest."""
_SIGNIFICANT = 3.0


@dataclass(frozen=True, eq=False)
class Mitigation:
    """Inverts measured `<Z>` = offset_i + contrast_i cos(w - tilt_i) of circuit i, ideal cos(w).

    Arrays of (circuits,); w in [0, pi] is the polar angle of the ideal Bloch vector. Contrasts are
    negative if 0 and 1 are swapped. Tilts lie in [-pi/2, pi/2]; readout errors alone cause none.
    With a tilt, two w near a pole have the same measured `<Z>`; the one farther from that pole is
    chosen. `covariance` is that of (offset, contrast, tilt), (circuits, 3, 3).
    """

    offset: FloatArray
    contrast: FloatArray
    tilt: FloatArray
    covariance: FloatArray

    def apply(self, z: FloatArray) -> FloatArray:
        """The ideal `<Z>` for measured z (B, circuits).

        Values that no ideal circuit can show are clipped to [-1, 1]; without tilt this is the
        least-squares solution under that constraint.
        """
        return self.ideal_cosine(self.tilted_cosine(z))

    def tilted_cosine(self, z: FloatArray) -> FloatArray:
        """cos(w - tilt) for measured z; shot noise may take it out of the range of w."""
        return np.asarray((z - self.offset) / self.contrast)

    def ideal_cosine(self, u: FloatArray) -> FloatArray:
        """cos(w) for u = cos(w - tilt), w in [0, pi]; u is clipped to the range of w."""
        u = self._reachable(u)
        if not self._tilted:
            return u
        return np.asarray(np.cos(self.tilt) * u - np.sin(self.tilt) * np.sqrt(1.0 - u * u))

    def _reachable(self, u: FloatArray) -> FloatArray:
        """u = cos(w - tilt), clipped to the values that w in [0, pi] can reach."""
        if not self._tilted:
            return np.asarray(np.minimum(np.maximum(u, -1.0), 1.0))
        border = np.cos(self.tilt)
        least = np.where(self.tilt > 0.0, -border, -1.0)
        most = np.where(self.tilt < 0.0, border, 1.0)
        return np.asarray(np.minimum(np.maximum(u, least), most))

    def of_mean(self, weights: FloatArray) -> Mitigation:
        """The mitigation of the mean of `tilted_cosine` over places; `weights` (places,) sum to 1.

        The arrays of this one are ordered place by place, as those of circuits side by side. The
        mean of cos(w - tilt_p) is again contrast cos(w - tilt): it is inverted and clipped once, so
        that shot noise beyond [-1, 1] at a place averages out. Without tilts it is the mean itself.
        The covariances are those of the mean over independently calibrated places.
        """
        tilt = self.tilt.reshape(len(weights), -1)
        along, across = weights @ np.cos(tilt), weights @ np.sin(tilt)
        unit = np.stack([1 / self.contrast, 1 / self.contrast, np.ones_like(self.tilt)], axis=1)
        covariance = self.covariance * unit[:, :, None] * unit[:, None, :]
        return Mitigation(
            np.zeros_like(along),
            np.hypot(along, across),
            np.arctan2(across, along),
            np.einsum("p,pcij->cij", weights**2, covariance.reshape(*tilt.shape, 3, 3)),
        )

    def standard_error(self, z: FloatArray, shots: int) -> FloatArray:
        """The standard error of `apply(z)` for z (B, circuits) measured with `shots`."""
        counted, calibrated = self.variances(z, shots)
        return np.asarray(np.sqrt(counted + calibrated))

    def variances(self, z: FloatArray, shots: CircuitShots) -> tuple[FloatArray, FloatArray]:
        """The variances of `apply(z)` for z (B, circuits) measured with `shots`, to first order.

        The first is due to shot noise, the second to the uncertainty of the calibration.
        """
        u = self._reachable(self.tilted_cosine(z))
        across = np.sqrt(1.0 - u * u)
        slope = np.ones_like(u)
        if self._tilted:
            slope = np.cos(self.tilt) + np.sin(self.tilt) * u / np.maximum(across, 1e-3)
        slope = slope / self.contrast
        by_tilt = -np.sin(self.tilt) * u - np.cos(self.tilt) * across
        gradient = np.stack([-slope, -slope * u, by_tilt], axis=-1)  # (B, circuits, 3)
        calibrated = np.einsum("bci,cij,bcj->bc", gradient, self.covariance, gradient)
        counted = slope**2 * np.clip(1.0 - z * z, 1.0 / shots, None) / shots
        return np.asarray(counted), np.asarray(calibrated)

    @cached_property
    def _tilted(self) -> bool:
        return bool(self.tilt.any())


def readout_mitigation(calibration: Calibration, executable: Executable) -> Mitigation:
    """Undo the readout of the executable's qubits: offset p01 - p10, contrast 1 - p01 - p10.

    Raises:
        CalibrationError: a qubit, or the readout, was not calibrated.
    """
    executable.source.require_narrow("Readout mitigation", "Use product_mitigation.")
    fit, rows = calibration.readout, calibration.rows(executable.qubits)
    if fit is None:
        raise CalibrationError(
            "The calibration has no assignment matrices.",
            *calibration.unfitted,
            _missing_part_hint("response", calibration.response, "readout"),
        )
    p10, p01, v10, v01 = (
        np.array(column)[rows]
        for column in (fit.p10, fit.p01, np.square(fit.p10_error), np.square(fit.p01_error))
    )
    covariance = np.zeros((len(rows), 3, 3))
    covariance[:, 0, 0] = covariance[:, 1, 1] = v01 + v10
    covariance[:, 0, 1] = covariance[:, 1, 0] = v10 - v01
    return Mitigation(p01 - p10, 1.0 - p01 - p10, np.zeros(len(rows)), covariance)


def response_mitigation(
    calibration: Calibration, executable: Executable, *, any_side: bool = False
) -> Mitigation:
    """Undo readout and gate errors of circuits sx rz(a) sx (rx(a) where it is native).

    The response curve b + c cos(a) + s sin(a) is offset + contrast cos(w - tilt) in the ideal polar
    angle w = a - pi (a for rx). Circuits without a rotation are assumed to lie on the same curve.
    Angles that are not polar may lie on either side of |0>, where a tilt has opposite effects.
    `<Z>` does not tell the side, so the mean effect is undone; with `any_side` the tilt is undone
    as if the side were known.

    Raises:
        CalibrationError: the executable is not of level 2, a qubit was not calibrated or is tilted
            by more than MAX_TILT_RAD without `any_side`, or no response was calibrated.
    """
    check_response_level(executable.level, predistort=any_side)
    executable.source.require_narrow("Response mitigation", "Use product_mitigation.")
    fit, rows = calibration.response, calibration.rows(executable.qubits)
    if fit is None:
        raise CalibrationError(
            "The calibration has no response curves.",
            *calibration.unfitted,
            _missing_part_hint("readout", calibration.readout, "response"),
        )
    polar = polar_curves(fit, executable.device.native)
    offset, contrast, tilt = (of[rows] for of in (polar.offset, polar.contrast, polar.tilt))
    scatter = _scatter(calibration)[rows]
    covariance = polar.covariance[rows] * scatter[:, None, None]
    # Correcting a tilt smaller than its error does more harm than good.
    significant = np.abs(tilt) > _SIGNIFICANT * np.sqrt(covariance[:, 2, 2])
    doubtful = scatter > 1.0
    if not any_side:
        most = np.where(doubtful, _MAX_DOUBTFUL_RAD, MAX_TILT_RAD)
        _check_tilt(executable.qubits[significant & (np.abs(tilt) > most)])
    undone = significant & (any_side or (executable.has_polar_angles & ~doubtful))
    contrast = np.where(undone, contrast, contrast * np.cos(tilt))
    return Mitigation(offset, contrast, np.where(undone, tilt, 0.0), covariance)


def _scatter(calibration: Calibration) -> FloatArray:
    """The factors for the variances of response curves, (qubits,): 1 where the fit is correct.

    For a misfit the factor is the chi-square per degree of freedom (Birge's ratio), because its
    counts scatter more than shot noise.
    """
    factor = np.ones(len(calibration.qubits))
    for misfit in misfits(calibration, ["response"]):
        factor[calibration.qubits.index(misfit.qubit)] = misfit.chi_square / misfit.degrees
    return factor


def _check_tilt(tilted: NDArray[np.intp]) -> None:
    if tilted.size:
        which = listed([str(q) for q in np.unique(tilted)])
        raise CalibrationError(
            f"The response of qubit {which} is tilted by more "
            f"than {MAX_TILT_RAD} rad, so one measured <Z> can come from two ideal ones.",
            f"Predistort the angles instead ({option('predistort')}), or use "
            f"{option('mitigation')} readout, or other qubits.",
        )


def _missing_part_hint(other: str, fit: object, part: str) -> str:
    """What to try if a calibration lacks a part: use the other one, if it has that."""
    if fit is None:
        return f"Calibrate the {part}: `qcompile calibrate`."
    return f"Use {option('mitigation')} {other}, or calibrate the {part}."


def check_response_level(level: int, *, predistort: bool = False) -> None:
    """Raise CalibrationError if response curves do not describe the circuits of a level.

    `predistort` means that they are needed to predistort angles, so the hint differs.
    """
    if level != 2:
        raise CalibrationError(
            f"Response curves need level 2, found level {level}.",
            f"They describe sx rz sx; use {option('level')} 2"
            + (
                f", or {option('mitigation')} readout without {option('predistort')}."
                if predistort
                else f" or {option('mitigation')} readout."
            ),
        )
