"""How good the qubits of a device are: which are used, and which come first."""

from __future__ import annotations

import math
from typing import NamedTuple

from qcompile.device import Device, Qubit
from qcompile.native import NativeGates
from qcompile.noise.channels import channel_after

USABLE_CONTRAST = 0.8
"""A qubit whose pulses and readout leave less of `<Z>` is not used as long as there are others."""
REFERENCE_SHOTS = 1024
"""The shots for which the error of a qubit is stated, and by which qubits are ranked."""


class _Quality(NamedTuple):
    """What the pulses of a circuit and the readout leave of `<Z>`, and its mean square error."""

    left: float
    error: float


def usable(device: Device) -> tuple[int, ...]:
    """The qubits worth using, the one with the least `mean_square_error` first."""
    qualities = _qualities(device)
    reasons = _reasons(device, qualities)
    rest = [q for q in range(len(qualities)) if q not in reasons]
    return tuple(sorted(rest, key=lambda q: qualities[q].error))


def unusable(device: Device) -> dict[int, str]:
    """The qubits that are not used, each with the reason in words.

    They are those of `left_out`, and those that keep less than USABLE_CONTRAST of `<Z>`. If none
    keeps as much, those whose 0 and 1 are swapped and that keep as much otherwise are used, which
    need mitigation; if there are none of them, the best alone.
    """
    return _reasons(device, _qualities(device))


def expected_error(device: Device, qubit: int) -> float | None:
    """The root of `mean_square_error`, in units of `<Z>`; None where it is infinite."""
    error = mean_square_error(device, qubit)
    return math.sqrt(error) if math.isfinite(error) else None


def mean_square_error(device: Device, qubit: int) -> float:
    """The expected square of the error of `<Z>` on `qubit` with readout mitigation.

    It is that of a circuit at level 2, sx rz sx (or rx), at REFERENCE_SHOTS, averaged over `<Z>` in
    [-1, 1]. The measured `<Z>` is b + k `<Z>`, by the pulses and the readout; readout mitigation
    takes it for h + g `<Z>`, the line through |0> and |1> as they are measured, and undoes that.
    What remains is shot noise, 1 / g^2 of it, and what the pulses do beyond the calibration:

        (1 - b^2 - k^2 / 3) / (shots g^2)  +  ((b - h) / g)^2  +  (k / g - 1)^2 / 3

    It is infinite where g is 0; where 0 and 1 are swapped, g is negative and undoes that too. The
    clipping to [-1, 1] is not counted.
    """
    return _quality(device.qubits[qubit], device.native).error


def _qualities(device: Device) -> list[_Quality]:
    native = device.native
    return [_quality(qubit, native) for qubit in device.qubits]


def _quality(qubit: Qubit, native: NativeGates) -> _Quality:
    shift, contrast = qubit.p01 - qubit.p10, qubit.contrast
    # Between two pulses the vector lies across; what the first adds along z, the second turns to y,
    # where it is not seen.
    *others, last = native.pulses
    pulse = channel_after(last, qubit)
    slope = pulse.across * pulse.along if others else pulse.along
    b, k = shift + contrast * pulse.added, contrast * slope
    flip = channel_after(native.one, qubit)
    one = flip.added - flip.along  # r_z of |1> as the calibration prepares it
    h, g = shift + contrast * (1 + one) / 2, contrast * (1 - one) / 2
    if g == 0:
        return _Quality(k, math.inf)
    variance = (1 - b**2 - k**2 / 3) / (REFERENCE_SHOTS * g**2)
    return _Quality(k, variance + ((b - h) / g) ** 2 + (k / g - 1) ** 2 / 3)


def _reasons(device: Device, qualities: list[_Quality]) -> dict[int, str]:
    reasons = dict.fromkeys(sorted(set(device.left_out)), "is in left_out")
    rest = [q for q in range(len(qualities)) if q not in reasons]
    weak = [q for q in rest if qualities[q].left < USABLE_CONTRAST]
    if weak == rest:
        weak = [q for q in rest if abs(qualities[q].left) < USABLE_CONTRAST]
    if weak == rest and rest:
        weak.remove(min(rest, key=lambda q: qualities[q].error))
    reasons |= {q: f"keeps {qualities[q].left:.2f} of <Z>" for q in weak}
    return dict(sorted(reasons.items()))
