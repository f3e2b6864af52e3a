"""Undoing the readout of products of Z, in closed form.

The Z that a qubit i shows is offset_i + contrast_i Z_i, so the product over a set S is measured as

    <M_S> = sum over T in S of (product of contrast over T) (product of offset over S - T) <Z_T>.

With the products of all subsets measured in the same shots, this is undone term by term:

    <Z_S> = sum over T in S of (-1)**|S - T| (product of offset over S - T) <M_T>
            / (product of contrast over S).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.ir import Program
from qcompile.passes import Executable

_Bits = tuple[int, ...]


def with_sub_products(program: Program) -> Program:
    """The program with all products of subsets of its observables too; its own come first."""
    own = program.measured
    parts = (part for observable in own for part in _subsets(observable) if part)
    return replace(program, observables=tuple(dict.fromkeys([*own, *parts])))


@dataclass(frozen=True, eq=False)
class ProductMitigation:
    """Inverts the readout of products of Z.

    `products` are the bits of all measured products; the first `count` are asked for, and those
    of their subsets follow. Arrays are (bits,): what each bit's qubit does to its Z. `variance` is
    that of offset and of contrast, `covariance` that between them.
    """

    products: tuple[_Bits, ...]
    count: int
    offset: FloatArray
    contrast: FloatArray
    variance: FloatArray
    covariance: FloatArray

    @cached_property
    def _places(self) -> dict[_Bits, int]:
        """The number of each product, counted from 1; that of no bits, which is 1, is 0."""
        return {bits: number for number, bits in enumerate([(), *self.products])}

    @cached_property
    def _matrix(self) -> FloatArray:
        """The factor of each measured product, of no bits first, in each ideal one."""
        matrix = np.zeros((len(self._places), len(self.products)))
        for column, bits in enumerate(self.products):
            for part in _subsets(bits):
                rest = [bit for bit in bits if bit not in part]
                matrix[self._places[part], column] = np.prod(-self.offset[rest])
            matrix[:, column] /= np.prod(self.contrast[list(bits)])
        return matrix

    def apply(self, z: FloatArray) -> FloatArray:
        """`<Z_S>` (B, count), clipped to [-1, 1], of measured products z (B, products)."""
        return np.asarray(np.clip(self._unclipped(z)[:, : self.count], -1.0, 1.0))

    def standard_error(self, z: FloatArray, shots: int) -> FloatArray:
        """The standard error of `apply(z)` for z (B, products) measured together in `shots`."""
        counted, calibrated = self.variances(z, shots)
        return np.asarray(np.sqrt(counted + calibrated))

    def variances(self, z: FloatArray, shots: int) -> tuple[FloatArray, FloatArray]:
        """The variances of `apply(z)`, (B, count) each: shot noise, and the calibration's.

        Products of the same shots are correlated: <M_S M_T> is the product of the bits that are in
        one of them only. Those of the calibration are to first order.
        """
        measured = np.concatenate([np.ones((len(z), 1)), z], axis=1)
        ideal = np.concatenate([np.ones((len(z), 1)), self._unclipped(z)], axis=1)
        counted, calibrated = np.zeros((2, len(z), self.count))
        for column, bits in enumerate(self.products[: self.count]):
            parts = _subsets(bits)
            weights = self._matrix[[self._places[part] for part in parts], column]
            for part, weight in zip(parts, weights, strict=True):
                for other, by in zip(parts, weights, strict=True):
                    both = self._places[tuple(sorted({*part} ^ {*other}))]
                    product = measured[:, self._places[part]] * measured[:, self._places[other]]
                    counted[:, column] += weight * by * (measured[:, both] - product) / shots
            for bit in bits:
                without = self._places[tuple(other for other in bits if other != bit)]
                by_offset, by_contrast = ideal[:, without], ideal[:, column + 1]
                calibrated[:, column] += (
                    self.variance[bit] * (by_offset**2 + by_contrast**2)
                    + 2 * self.covariance[bit] * by_offset * by_contrast
                ) / self.contrast[bit] ** 2
        return counted, calibrated

    def _unclipped(self, z: FloatArray) -> FloatArray:
        return np.asarray(z @ self._matrix[1:] + self._matrix[0])


def product_mitigation(
    calibration: Calibration, executable: Executable, count: int
) -> ProductMitigation:
    """Undo the readout of an executable of a program `with_sub_products`, `count` of them its own.

    Raises:
        CalibrationError: a qubit, or the readout, was not calibrated.
    """
    fit, rows = calibration.readout, calibration.rows(executable.bit_qubits)
    if fit is None:
        raise CalibrationError(
            "The calibration has no assignment matrices.",
            *calibration.unfitted,
            "Calibrate the readout: `qcompile calibrate`.",
        )
    p10, p01, v10, v01 = (
        np.array(column)[rows]
        for column in (fit.p10, fit.p01, np.square(fit.p10_error), np.square(fit.p01_error))
    )
    products = executable.source.measured
    return ProductMitigation(products, count, p01 - p10, 1.0 - p01 - p10, v01 + v10, v10 - v01)


def _subsets(bits: Sequence[int]) -> list[_Bits]:
    """All subsets, the empty one and the whole included."""
    return [part for size in range(len(bits) + 1) for part in combinations(sorted(bits), size)]
