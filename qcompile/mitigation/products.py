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
from itertools import combinations, product

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.ir import Program
from qcompile.passes import Executable

_Bits = tuple[int, ...]


def with_sub_products(program: Program) -> Program:
    """The program with all products of subsets of its observables too; its own come first."""
    own = program.measured
    parts = dict.fromkeys(part for observable in own for part in _subsets(observable) if part)
    return replace(program, observables=(*own, *(part for part in parts if part not in own)))


@dataclass(frozen=True, eq=False)
class ProductMitigation:
    """Inverts the readout of products of Z, in `copies` of a program.

    `products` are the bits of all measured products of a copy; the first `count` are asked for, and
    those of their subsets follow. Arrays are (copies * bits,): what each bit's qubit does to its Z.
    `variance` is that of offset and of contrast, `covariance` that between them. Measured and ideal
    products are (B, copies * products), copy by copy.
    """

    products: tuple[_Bits, ...]
    count: int
    offset: FloatArray
    contrast: FloatArray
    variance: FloatArray
    covariance: FloatArray
    copies: int = 1

    @cached_property
    def _places(self) -> dict[_Bits, int]:
        """The number of each product, counted from 1; that of no bits, which is 1, is 0."""
        return {bits: number for number, bits in enumerate([(), *self.products])}

    @cached_property
    def _matrix(self) -> FloatArray:
        """The factor of each measured product, of no bits first, in each ideal one, of each copy.

        The shape is (copies, 1 + products, products).
        """
        offset, contrast = self._of_bits(self.offset), self._of_bits(self.contrast)
        matrix = np.zeros((self.copies, 1 + len(self.products), len(self.products)))
        for column, bits in enumerate(self.products):
            for part in _subsets(bits):
                rest = [bit for bit in bits if bit not in part]
                matrix[:, self._places[part], column] = np.prod(-offset[:, rest], axis=1)
            matrix[:, :, column] /= np.prod(contrast[:, bits], axis=1)[:, None]
        return matrix

    def apply(self, z: FloatArray) -> FloatArray:
        """`<Z_S>` (B, copies * count), clipped to [-1, 1], of measured z."""
        return np.asarray(np.clip(self.unclipped(z), -1.0, 1.0))

    def unclipped(self, z: FloatArray) -> FloatArray:
        """The same before it is clipped: shot noise may take it out of [-1, 1]."""
        return self._undone(z)[:, :, : self.count].reshape(len(z), -1)

    def standard_error(self, z: FloatArray, shots: int) -> FloatArray:
        """The standard error of `apply(z)` for z measured together in `shots`."""
        counted, calibrated = self.variances(z, shots)
        return np.asarray(np.sqrt(counted + calibrated))

    def variances(self, z: FloatArray, shots: int | CountArray) -> tuple[FloatArray, FloatArray]:
        """The variances of `apply(z)`: those of the shot noise, and of the calibration.

        `shots` may be (copies,), another number for each copy.
        Products of the same shots are correlated: <M_S M_T> is the product of the bits that are in
        one of them only. Those of the calibration are to first order.
        """
        one = np.ones((len(z), self.copies, 1))
        measured = np.concatenate([one, z.reshape(len(z), self.copies, -1)], axis=2)
        ideal = np.concatenate([one, self._undone(z)], axis=2)
        contrast = self._of_bits(self.contrast)
        variance, covariance = self._of_bits(self.variance), self._of_bits(self.covariance)
        counted, calibrated = np.zeros((2, len(z), self.copies, self.count))
        for column, bits in enumerate(self.products[: self.count]):
            parts = _subsets(bits)
            for part, other in product(parts, parts):
                by, also = self._places[part], self._places[other]
                both = self._places[tuple(sorted({*part} ^ {*other}))]
                together = measured[..., both] - measured[..., by] * measured[..., also]
                weight = self._matrix[:, by, column] * self._matrix[:, also, column]
                counted[..., column] += weight * together / shots
            for bit in bits:
                without = self._places[tuple(other for other in bits if other != bit)]
                by_offset, by_contrast = ideal[..., without], ideal[..., column + 1]
                calibrated[..., column] += (
                    variance[:, bit] * (by_offset**2 + by_contrast**2)
                    + 2 * covariance[:, bit] * by_offset * by_contrast
                ) / contrast[:, bit] ** 2
        return counted.reshape(len(z), -1), calibrated.reshape(len(z), -1)

    def _undone(self, z: FloatArray) -> FloatArray:
        """All products, (B, copies, products)."""
        of_copy = z.reshape(len(z), self.copies, -1).swapaxes(0, 1)
        return np.asarray(of_copy @ self._matrix[:, 1:] + self._matrix[:, :1]).swapaxes(0, 1)

    def _of_bits(self, values: FloatArray) -> FloatArray:
        return values.reshape(self.copies, -1)


def product_mitigation(
    calibration: Calibration, executable: Executable, count: int, copies: int = 1
) -> ProductMitigation:
    """Undo the readout of `copies` of a program `with_sub_products`, `count` of them its own.

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
    measured = executable.source.measured
    products = measured[: len(measured) // copies]
    offset, contrast = p01 - p10, 1.0 - p01 - p10
    return ProductMitigation(products, count, offset, contrast, v01 + v10, v10 - v01, copies)


def _subsets(bits: Sequence[int]) -> list[_Bits]:
    """All subsets, the empty one and the whole included."""
    return [part for size in range(len(bits) + 1) for part in combinations(sorted(bits), size)]
