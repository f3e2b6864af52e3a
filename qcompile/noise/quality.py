"""The quality of a device's qubits: which are used, and how they are ranked."""

from __future__ import annotations

import math
from typing import NamedTuple

from qcompile.device import Device, Qubit
from qcompile.native import NativeGates
from qcompile.noise.channels import channel_after

USABLE_CONTRAST = 0.8
"""A qubit whose pulses and readout preserve less of `<Z>` is used only if none is better."""
REFERENCE_SHOTS = 1024
"""The shots at which the error of a qubit is stated, and qubits are ranked."""


class _Quality(NamedTuple):
    """The fraction of `<Z>` left after pulses and readout, and its mean square error."""

    left: float
    error: float


def usable(device: Device) -> tuple[int, ...]:
    """The qubits good enough to use, sorted by `mean_square_error`."""
    qualities = _qualities(device)
    reasons = _reasons(device, qualities)
    rest = [q for q in range(len(qualities)) if q not in reasons]
    return tuple(sorted(rest, key=lambda q: qualities[q].error))


def unusable(device: Device) -> dict[int, str]:
    """The qubits that are not used, each with the reason.

    They are those in `left_out`, and those that preserve less than USABLE_CONTRAST of `<Z>`. If no
    qubit preserves that much, qubits with 0 and 1 swapped that otherwise do are used, which need
    mitigation. If there are none of those either, only the best qubit is used.
    """
    return _reasons(device, _qualities(device))


def expected_error(device: Device, qubit: int, shots: int = REFERENCE_SHOTS) -> float | None:
    """The root of `mean_square_error`, in units of `<Z>`; None if it is infinite."""
    error = mean_square_error(device, qubit, shots)
    return math.sqrt(error) if math.isfinite(error) else None


def mean_square_error(device: Device, qubit: int, shots: int = REFERENCE_SHOTS) -> float:
    """The expected squared error of `<Z>` on `qubit` with readout mitigation.

    It is that of a level 2 circuit, sx rz sx (or rx), at a number of shots, averaged over `<Z>` in
    [-1, 1]. Because of pulses and readout the measured `<Z>` is b + k `<Z>`; readout mitigation
    assumes h + g `<Z>`, the line through |0> and |1> as they are measured, and inverts it. That
    leaves shot noise, amplified by 1 / g^2, and the effect of pulses that the line misses:

        (1 - b^2 - k^2 / 3) / (shots g^2)  +  ((b - h) / g)^2  +  (k / g - 1)^2 / 3

    It is infinite if g is 0. If 0 and 1 are swapped, g is negative and corrects that too. Clipping
    to [-1, 1] is ignored.
    """
    return _quality(device.qubits[qubit], device.native, shots).error


def _qualities(device: Device) -> list[_Quality]:
    native = device.native
    return [_quality(qubit, native) for qubit in device.qubits]


def _quality(qubit: Qubit, native: NativeGates, shots: int = REFERENCE_SHOTS) -> _Quality:
    shift, contrast = qubit.p01 - qubit.p10, qubit.contrast
    # Between the two pulses the vector lies in the xy plane; the z component that the first one
    # adds is turned into y by the second, where it is not measured.
    *others, last = native.pulses
    pulse = channel_after(last, qubit)
    slope = pulse.across * pulse.along if others else pulse.along
    b, k = shift + contrast * pulse.added, contrast * slope
    flip = channel_after(native.one, qubit)
    one = flip.added - flip.along  # r_z of |1> as the calibration prepares it
    h, g = shift + contrast * (1 + one) / 2, contrast * (1 - one) / 2
    if g == 0:
        return _Quality(k, math.inf)
    variance = (1 - b**2 - k**2 / 3) / (shots * g**2)
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
