"""How many shots a calibration needs for the runs that it mitigates."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.execution.offline import OfflineExecutor
from qcompile.mitigation.measure import CALIBRATION_SHOTS, Part, calibrate
from qcompile.mitigation.products import ProductMitigation, product_mitigation
from qcompile.mitigation.undo import Mitigation, readout_mitigation, response_mitigation
from qcompile.passes import Executable

MIN_SHOTS = 256
"""Fewer shots save almost nothing, and make the chi-square test reject good response curves."""
SHARE = 0.05
"""The largest variance of the calibration, as a fraction of that of the shot noise."""
_Z = (np.arange(32) + 0.5) / 16 - 1
"""The values of ideal `<Z>` over which variances are averaged."""


def enough_shots(
    executable: Executable, part: Part, shots: CircuitShots, importance: FloatArray
) -> int:
    """The shots of a calibration whose shot noise is small compared with that of `shots`.

    The error of a calibration is the same in the whole run. Its variance in `<Z>`, by
    `Mitigation.variances`, must be at most SHARE of the variance of the shot noise of a row:

        sum over circuits of importance * calibrated  <=  SHARE * sum of importance * counted,

    both averaged over ideal `<Z>` in [-1, 1], as in placement. `importance` (circuits,) is the cost
    of a squared error of a circuit's `<Z>` (`Policy.importance`). A circuit in several places has
    one entry for each; for a mean over places multiply by the squares of the weights. The
    covariance is that of a calibration of the noise model, which falls as 1 / shots. The result is
    a power of two in [MIN_SHOTS, CALIBRATION_SHOTS].
    """
    model = OfflineExecutor(executable.device, 0)
    known = calibrate(model, executable.qubits, CALIBRATION_SHOTS, parts=[part])
    mitigation = (
        readout_mitigation(known, executable)
        if part == "readout"
        else response_mitigation(known, executable, any_side=True)
    )
    return _enough(*mitigation.variances(_measured_z(mitigation), shots), importance)


def enough_product_shots(
    executable: Executable, count: int, shots: CountArray, importance: FloatArray
) -> int:
    """The same for products of Z, of which `product_mitigation` undoes `count` in each copy.

    `shots` (copies,) are those of a row in each copy, and `importance` (copies * count,) is that of
    the observables. The average is over states without correlations: the ideal `<Z>` of each bit is
    anywhere in [-1, 1].
    """
    model = OfflineExecutor(executable.device, 0)
    known = calibrate(model, executable.bit_qubits, CALIBRATION_SHOTS, parts=["readout"])
    mitigation = product_mitigation(known, executable, count, len(shots))
    return _enough(*mitigation.variances(_measured_products(mitigation), shots), importance)


def _enough(counted: FloatArray, calibrated: FloatArray, importance: FloatArray) -> int:
    """The shots at which the calibration's variance is small enough, for those at the usual shots.

    Both are (numbers, observables).
    """
    noise, error = (counted * importance).sum(), (calibrated * importance).sum()
    if not error:
        return MIN_SHOTS
    wanted = CALIBRATION_SHOTS * error / (SHARE * noise)
    return int(2 ** np.ceil(np.log2(np.clip(wanted, MIN_SHOTS, CALIBRATION_SHOTS))))


def _measured_z(mitigation: Mitigation) -> FloatArray:
    """The measured `<Z>` of each circuit for each ideal `<Z>`, (numbers, circuits)."""
    polar = np.arccos(_Z)[:, None] - mitigation.tilt
    return np.asarray(mitigation.offset + mitigation.contrast * np.cos(polar))


def _measured_products(mitigation: ProductMitigation) -> FloatArray:
    """The measured products of random ideal `<Z>` of the bits, (numbers, copies * products)."""
    rng = np.random.default_rng(0)
    ideal = rng.permuted(np.tile(_Z, (mitigation.offset.size, 1)), axis=1).T
    z = (mitigation.offset + mitigation.contrast * ideal).reshape(len(_Z), mitigation.copies, -1)
    products = [z[:, :, list(bits)].prod(axis=2) for bits in mitigation.products]
    return np.stack(products, axis=2).reshape(len(_Z), -1)
