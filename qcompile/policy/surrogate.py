"""The classical surrogate of a policy: the functions that its circuits compute, in closed form.

A one-qubit circuit is a sequence of rotations about z and y, so its `<Z>` is a polynomial in the
cosines and sines of its angles. The Bloch vector is propagated through the rotations as three such
polynomials; with theta substituted, they are fixed functions of the observation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import PolicyError
from qcompile.ir import NEGLIGIBLE_RAD, Angle, Circuit
from qcompile.ir.table import AngleTable, are_large
from qcompile.policy.decision import softmax
from qcompile.policy.policy import Policy
from qcompile.simulate import alternating

MOST_TERMS = 10_000
"""The most terms; more would not help a reader, and their matrix would fill the memory."""

MOST_COEFFICIENTS = 1e4
"""The largest sum of a polynomial's absolute coefficients; `<Z>` is then accurate to 1e-11."""

_VANISHES = 1e-15
"""A coefficient this small relative to the largest of its circuit is a rounding error."""

Factor = tuple[int, int, int]
"""cos(form)^p sin(form)^q as (index of the form, p, q), q in (0, 1) and not both 0."""

Monomial = tuple[Factor, ...]
"""A product of factors, one for each form, sorted; () is 1."""

Polynomial = dict[Monomial, float]


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A linear softmax policy on fixed functions, equal to `policy` without noise.

    logits = features weights^T + bias. weights (k, terms); bias (k,). The angles `forms` are
    linear in the inputs, and `basis` says which of their cosines and sines a term multiplies.
    """

    policy: Policy
    forms: tuple[Angle, ...]
    basis: tuple[Monomial, ...]
    weights: FloatArray
    bias: FloatArray

    @classmethod
    def of(cls, policy: Policy) -> Surrogate:
        """The surrogate of `policy`.

        Raises:
            PolicyError: it has too many terms, or a circuit's coefficients are too large to be
                exact.
        """
        policy.program.require_narrow("A surrogate")
        expansion = _Expansion(policy)
        polynomials: list[Polynomial] = []
        basis: dict[Monomial, None] = {}
        for index, circuit in enumerate(policy.trained_program.circuits):
            polynomials.append(expansion.expectation(circuit, index))
            basis |= dict.fromkeys(monomial for monomial in _by_degree(polynomials[-1]) if monomial)
            _require_few(len(basis), "The policy")
        column = {monomial: i for i, monomial in enumerate(basis)}
        coefficients = np.zeros((len(polynomials), len(basis) + 1))  # the last one: constants
        for row, polynomial in enumerate(polynomials):
            for monomial, coefficient in polynomial.items():
                coefficients[row, column.get(monomial, -1)] = coefficient
        weights = policy.folded().weights @ coefficients
        return cls(
            policy,
            tuple(expansion.forms),
            tuple(basis),
            weights[:, :-1],
            policy.bias + weights[:, -1],
        )

    @property
    def terms(self) -> tuple[str, ...]:
        """The functions as text, such as "sin(x0)", "cos(x3)^2" and "cos(x0)*sin(x1)"."""
        return tuple("*".join(self._texts(monomial)) for monomial in self.basis)

    def _texts(self, monomial: Monomial) -> Iterable[str]:
        for form, cosines, sines in monomial:
            if cosines:
                yield f"cos({self.forms[form]})" + (f"^{cosines}" if cosines > 1 else "")
            if sines:
                yield f"sin({self.forms[form]})"

    @property
    def parameter_count(self) -> int:
        """The number of weights and biases; input scales belong to the functions."""
        return self.weights.size + self.bias.size

    @cached_property
    def _table(self) -> AngleTable:
        return AngleTable(self.forms, self.policy.program.inputs, ())

    @cached_property
    def _factors(self) -> tuple[tuple[Factor, ...], IntArray]:
        """The distinct factors, and their positions (factors of a term, terms); 0 stands for 1."""
        factors = tuple(dict.fromkeys(factor for monomial in self.basis for factor in monomial))
        position = {factor: i for i, factor in enumerate(factors, start=1)}
        index = np.zeros((max(map(len, self.basis), default=0), len(self.basis)), dtype=np.intp)
        for column, monomial in enumerate(self.basis):
            index[: len(monomial), column] = [position[factor] for factor in monomial]
        return factors, index

    def features(self, observations: FloatArray) -> FloatArray:
        """The values of the terms (B, terms) for observations (B, features).

        Raises:
            PolicyError: the observations have too few features.
        """
        x = self.policy.encode(observations)
        large = are_large(x, np.empty(0), self._table.largest)
        angles = self._table(x, np.empty(0), large=large)
        angles = np.broadcast_to(angles, (len(x), len(self.forms)))
        cos, sin = np.cos(angles), np.sin(angles)
        factors, index = self._factors
        values = np.ones((len(x), len(factors) + 1))
        for column, (form, cosines, sines) in enumerate(factors, start=1):
            values[:, column] = cos[:, form] ** cosines * sin[:, form] ** sines
        product = np.ones((len(x), len(self.basis)))
        for positions in index:
            product *= values[:, positions]
        return product

    def logits(self, observations: FloatArray) -> FloatArray:
        """The logits of `policy` (B, k) for observations (B, features)."""
        return np.asarray(self.features(observations) @ self.weights.T + self.bias)

    def probabilities(self, observations: FloatArray) -> FloatArray:
        """The action probabilities (B, k) for observations (B, features)."""
        return softmax(self.logits(observations))


def merged_inputs(policy: Policy) -> dict[str, Angle]:
    """Each input as plus or minus the first input equal to it, or as 0.

    Inputs are equal if they read the same feature with the same function, scale and gain. The
    functions of an encoder are odd, so the opposite scale or gain gives the opposite input, and 0
    gives 0.
    """
    first: dict[tuple[str, int, float, float], Angle] = {}
    merged = {}
    encoder = policy.encoder
    readings = zip(
        policy.program.inputs,
        encoder.functions,
        encoder.feature.tolist(),
        encoder.scale.tolist(),
        encoder.gains.tolist(),
        strict=True,
    )
    for name, function, feature, scale, gain in readings:
        sign = _sign(scale) * _sign(gain)
        size = (abs(scale), abs(gain)) if sign else (0.0, 0.0)
        equal = first.setdefault((function, feature, *size), Angle.symbol(name) * sign)
        merged[name] = equal * sign
    return merged


def _sign(value: float) -> float:
    return float((value > 0) - (value < 0))


class _Expansion:
    """`<Z>` of the circuits of a policy as polynomials in the cosines and sines of `forms`."""

    def __init__(self, policy: Policy):
        self._inputs = merged_inputs(policy)
        self.forms: dict[Angle, int] = {}

    def expectation(self, circuit: Circuit, index: int) -> Polynomial:
        """`<Z>` of a circuit; `index` is its number in messages.

        Raises:
            PolicyError: there are too many terms, or too large coefficients.
        """
        angles = alternating(circuit)
        angles = angles[: len(angles) // 2 * 2]  # a last z has no effect
        x: Polynomial = {}
        y: Polynomial = {}
        z: Polynomial = {(): 1.0}
        for position, angle in enumerate(angles):
            cos, sin = self._turn(angle)
            if position % 2 == 0:
                x, y = _rotated(y, x, cos, sin)
            else:
                z, x = _rotated(x, z, cos, sin)
            for polynomial in (x, y, z):
                _require_few(len(polynomial), f"Circuit {index}")
                _require_exact(polynomial, index)
        least = _VANISHES * max(map(abs, z.values()), default=0.0)
        return {monomial: value for monomial, value in z.items() if abs(value) >= least}

    def _turn(self, angle: Angle) -> tuple[Polynomial, Polynomial]:
        """Cosine and sine of an angle, with the addition theorem for its constant."""
        cos, sin = _cos_sin(angle.constant)
        form = Angle()
        for symbol, coefficient in angle.terms:
            form += self._inputs[symbol] * coefficient
        if form.is_constant:
            return {(): cos}, {(): sin}
        sign = _sign(form.terms[0][1])
        number = self.forms.setdefault(form * sign, len(self.forms))
        c, s = ((number, 1, 0),), ((number, 0, 1),)
        return {c: cos, s: -sign * sin}, {c: sin, s: sign * cos}


def _cos_sin(constant: float) -> tuple[float, float]:
    """Cosine and sine; exact integers at quarter turns, so that terms cancel exactly."""
    quarter = round(constant / (math.pi / 2))
    if abs(constant - quarter * math.pi / 2) > NEGLIGIBLE_RAD:
        return math.cos(constant), math.sin(constant)
    return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]


def _rotated(
    first: Polynomial, second: Polynomial, cos: Polynomial, sin: Polynomial
) -> tuple[Polynomial, Polynomial]:
    """The pair second cos - first sin, first cos + second sin."""
    return (
        _sum(_times(second, cos), _times(first, sin, -1.0)),
        _sum(_times(first, cos), _times(second, sin)),
    )


def _sum(left: Polynomial, right: Polynomial) -> Polynomial:
    total = dict(left)
    for monomial, value in right.items():
        total[monomial] = total.get(monomial, 0.0) + value
    return {monomial: value for monomial, value in total.items() if value}


def _times(polynomial: Polynomial, turn: Polynomial, sign: float = 1.0) -> Polynomial:
    """`sign` times a polynomial times `turn`, whose monomials are 1 or a single cosine or sine."""
    product: Polynomial = {}
    for factor, scale in turn.items():
        if not scale:
            continue
        for monomial, value in polynomial.items():
            for term, coefficient in _products(monomial, factor):
                product[term] = product.get(term, 0.0) + sign * coefficient * scale * value
    return product


def _products(monomial: Monomial, factor: Monomial) -> Iterable[tuple[Monomial, float]]:
    """A monomial times a single factor, as monomials with coefficients, using sin^2 = 1 - cos^2."""
    if not factor:
        return [(monomial, 1.0)]
    ((form, cosines, sines),) = factor
    others = tuple(f for f in monomial if f[0] != form)
    for other, power, odd in monomial:
        if other == form:
            cosines, sines = cosines + power, sines + odd
    if sines < 2:
        return [(_insert(others, (form, cosines, sines)), 1.0)]
    return [
        (_insert(others, (form, cosines, 0)), 1.0),
        (_insert(others, (form, cosines + 2, 0)), -1.0),
    ]


def _insert(others: Monomial, factor: Factor) -> Monomial:
    return tuple(sorted((*others, factor))) if factor[1] or factor[2] else others


def _by_degree(polynomial: Polynomial) -> list[Monomial]:
    """The monomials of a polynomial, lowest degree first."""
    return sorted(polynomial, key=lambda m: (sum(p + q for _, p, q in m), m))


def _require_few(terms: int, what: str) -> None:
    if terms > MOST_TERMS:
        raise PolicyError(
            f"{what} has too many terms for a surrogate.",
            f"It has {terms:,}; the limit is {MOST_TERMS:,}.",
            "Each different angle in a circuit multiplies them: put fewer inputs on a qubit, "
            "or give the copies of an input the same scale.",
        )


def _require_exact(polynomial: Polynomial, index: int) -> None:
    total = sum(map(abs, polynomial.values()))
    if total > MOST_COEFFICIENTS:
        raise PolicyError(
            f"The surrogate of circuit {index} would not be exact: its terms nearly cancel.",
            f"Their coefficients add up to {total:,.0f}; the limit is {MOST_COEFFICIENTS:,.0f}.",
            "Encode the same input fewer times on one qubit.",
        )
