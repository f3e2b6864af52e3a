"""Ideal evaluation of a Program for a whole batch, with the same code for numpy and torch.

Every circuit is a sequence of rotations z, y, z, y, ... from |0>, so all circuits of a program
advance together, one axis a step; a step is a few operations on (observations, circuits) arrays.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from qcompile.arrays import ComplexArray, IntArray
from qcompile.errors import CircuitError
from qcompile.ir import NEGLIGIBLE_RAD, Angle, Circuit, LateAngle, Program
from qcompile.ir.table import AngleTable, Array, are_large

_HALF_PI = np.pi / 2


class Simulator:
    """Evaluates the circuits of `program` without noise.

    `xp` is numpy or torch, `dtype` the type of its constants. x has shape (B, inputs) and theta
    (parameters,), both arrays of `xp`; results have shape (B, circuits).

    Raises:
        CircuitError: the program has late angles, and `xp` is not numpy.
    """

    def __init__(self, program: Program, xp: ModuleType = np, dtype: Any = np.float64):
        if program.late_angles and xp is not np:
            raise CircuitError(
                "A fused program can only be evaluated with numpy.",
                "For torch, pass the program before it was compiled.",
            )
        program.require_narrow("A Simulator")
        self._xp, self._size = xp, len(program)
        self._words = f"{program!r}, {xp.__name__}"
        self._late_angles = (
            LateAngles(program.late_angles, program.inputs, program.parameters)
            if program.late_angles
            else None
        )
        inputs = (*program.inputs, *(late.name for late in program.late_angles))
        columns = [alternating(circuit) for circuit in program.circuits]
        self._steps: list[_Step] = []
        forms: dict[tuple[object, ...], int] = {}
        self._phases = _Phases(columns, inputs, program.parameters) if xp is np else None
        for position in range(max(map(len, columns), default=0)):
            angles = [c[position] if position < len(c) else Angle() for c in columns]
            table = AngleTable(angles, inputs, program.parameters, xp, dtype)
            form = forms.setdefault(tuple(a.terms for a in angles), len(self._steps))
            axis = "z" if position % 2 == 0 else "y"
            self._steps.append(_Step(axis, table, form, xp, dtype))
        self._relevant = _relevant(self._steps)
        self._largest = _largest(self._steps)
        self._last_z = next((step for step in reversed(self._relevant) if step.axis == "z"), None)

    def __repr__(self) -> str:
        return f"Simulator({self._words})"

    def _inputs(self, x: Array, theta: Array) -> Array:
        if self._late_angles is None:
            return x
        return np.concatenate([x, self._late_angles(x, theta)], axis=-1)

    def _are_large(self, x: Array, theta: Array) -> bool:
        return self._xp is np and are_large(x, theta, self._largest)

    def expectation(self, x: Array, theta: Array) -> Array:
        """`<Z>` of every circuit for every observation, (B, circuits), in [-1, 1]."""
        batch, x = len(x), self._inputs(x, theta)
        large = self._are_large(x, theta)
        turns: dict[int, tuple[Array, Array]] = {}
        # The Bloch vector, from |0>: None stands for 0 and, in r_z, for 1.
        r_x = r_y = r_z = None
        for step in self._relevant:
            cos, sin = step.turn(x, theta, turns, large)
            if step.axis == "z":
                if step is self._last_z:  # r_y no longer matters
                    r_x = r_x * cos if r_y is None else r_x * cos - r_y * sin
                elif r_y is None:
                    r_x, r_y = r_x * cos, r_x * sin
                else:
                    r_x, r_y = r_x * cos - r_y * sin, r_x * sin + r_y * cos
            elif r_x is None:
                r_x, r_z = sin, cos
            elif step is self._relevant[-1]:
                r_z = r_z * cos - r_x * sin
            else:
                r_x, r_z = r_x * cos + r_z * sin, r_z * cos - r_x * sin
        if r_z is None:
            return self._xp.ones((batch, self._size), dtype=x.dtype)
        if r_z.ndim == 1:
            return self._xp.broadcast_to(r_z, (batch, self._size))
        return r_z

    def euler(self, x: Array, theta: Array) -> tuple[Array, Array, Array]:
        """first, polar, last with Rz(last) Ry(polar) Rz(first) = circuit, up to global phase.

        numpy only. polar lies in [0, pi].
        """
        x = self._inputs(x, theta)
        large = self._are_large(x, theta)
        # The first column (alpha, beta) of an SU(2) matrix determines the rest.
        alpha = np.ones((len(x), self._size), dtype=complex)
        beta = np.zeros_like(alpha)
        assert self._phases is not None
        phases = self._phases(x, theta, large)
        for step in self._steps:
            if step.axis == "z":
                phase = next(phases)
                alpha, beta = alpha * phase.conj(), beta * phase
            else:
                half = step.table(x, theta, large=large) / 2
                cos, sin = np.cos(half), np.sin(half)
                alpha, beta = cos * alpha - sin * beta, sin * alpha + cos * beta
        return euler_angles(alpha, beta)


def euler_angles(alpha: Array, beta: Array) -> tuple[Array, Array, Array]:
    """first, polar, last of SU(2) matrices whose first columns are (alpha, beta).

    The matrix is Rz(last) Ry(polar) Rz(first) up to global phase, and polar lies in [0, pi].
    """
    size_alpha, size_beta = np.abs(alpha), np.abs(beta)
    # Where one of them vanishes its phase is free: choose it so that one z rotation is 0.
    total = np.where(size_alpha > NEGLIGIBLE_RAD, -2 * np.angle(alpha), 0.0)
    difference = np.where(size_beta > NEGLIGIBLE_RAD, 2 * np.angle(beta), 0.0)
    total = np.where(size_alpha > NEGLIGIBLE_RAD, total, difference)
    difference = np.where(size_beta > NEGLIGIBLE_RAD, difference, total)
    polar = 2 * np.arctan2(size_beta, size_alpha)
    return (total - difference) / 2, polar, (total + difference) / 2


class LateAngles:
    """The values of a program's late angles: (B, inputs), (parameters,) to (B, late angles)."""

    def __init__(
        self,
        late_angles: Sequence[LateAngle],
        inputs: Sequence[str],
        parameters: Sequence[str],
    ):
        blocks = tuple(dict.fromkeys(late.block for late in late_angles))
        program = Program(blocks, tuple(inputs), tuple(parameters))
        self._simulator = Simulator(program)
        self._only_polar = all(late.part == "polar" for late in late_angles)
        columns = {block: i for i, block in enumerate(blocks)}
        index = np.array([columns[late.block] for late in late_angles])
        parts = np.array([("first", "polar", "last").index(late.part) for late in late_angles])
        self._one_each = np.array_equal(index, np.arange(len(blocks)))
        self._index, self._parts = index, parts

    @property
    def are_polar(self) -> bool:
        """Whether late angle i is the polar angle of block i, and blocks are not shared."""
        return self._only_polar and self._one_each

    def polar_cosines(self, x: Array, theta: Array) -> Array:
        """The cosines of the blocks' polar angles, which are their `<Z>` from |0>: (B, blocks)."""
        return np.minimum(np.maximum(self._simulator.expectation(x, theta), -1.0), 1.0)

    def __call__(self, x: Array, theta: Array) -> Array:
        if not self._only_polar:
            euler = np.stack(self._simulator.euler(x, theta))
            return euler[self._parts, :, self._index].T
        polar = np.arccos(self.polar_cosines(x, theta))
        return polar if self._one_each else polar[:, self._index]


class _Phases:
    """exp(i angle / 2) of the z rotations, step by step; equal open angles are computed once."""

    def __init__(
        self, columns: Sequence[Sequence[Angle]], inputs: Sequence[str], parameters: Sequence[str]
    ):
        distinct: dict[Angle, int] = {}
        self._steps: list[ComplexArray | slice | IntArray] = []
        for position in range(0, max(map(len, columns), default=0), 2):
            angles = [c[position] if position < len(c) else Angle() for c in columns]
            if all(angle.is_constant for angle in angles):
                half = np.array([angle.moderate().constant for angle in angles]) / 2
                self._steps.append(np.exp(1j * half))
                continue
            first = len(distinct)
            of_step = np.array([distinct.setdefault(a, len(distinct)) for a in angles])
            are_new = np.array_equal(of_step, np.arange(first, len(distinct)))
            self._steps.append(slice(first, len(distinct)) if are_new else of_step)
        self._table = AngleTable([*distinct], inputs, parameters)

    def __call__(self, x: Array, theta: Array, large: bool) -> Iterator[Array]:
        phases = np.exp(1j * (self._table(x, theta, large=large) / 2))
        for step in self._steps:
            is_constant = isinstance(step, np.ndarray) and step.dtype == complex
            yield step if is_constant else phases[..., step]


class _Step:
    """One rotation of every circuit about the same axis."""

    def __init__(self, axis: str, table: AngleTable, form: int, xp: ModuleType, dtype: Any):
        self.axis, self.table, self._form, self._xp = axis, table, form, xp
        self.is_identity = table.is_constant and not table.constant.any()
        constant = table.constant
        self._cos = xp.asarray(np.cos(constant), dtype=dtype)
        self._sin = xp.asarray(np.sin(constant), dtype=dtype)
        self._unshifted = not constant.any()
        self._quarter = bool((np.abs(constant - _HALF_PI) < NEGLIGIBLE_RAD).all())

    def turn(
        self, x: Array, theta: Array, turns: dict[int, tuple[Array, Array]], large: bool
    ) -> tuple[Array, Array]:
        """Cosine and sine of the angle; `turns` caches those of linear forms shared by steps."""
        if self.table.is_constant:
            return self._cos, self._sin
        if self._form not in turns:
            angle = self.table.linear(x, theta, large=large)
            turns[self._form] = self._xp.cos(angle), self._xp.sin(angle)
        cos, sin = turns[self._form]
        if self._unshifted:
            return cos, sin
        if self._quarter:
            return -sin, cos
        return cos * self._cos - sin * self._sin, sin * self._cos + cos * self._sin


def _largest(steps: Sequence[_Step]) -> tuple[float, float]:
    pairs = [step.table.largest for step in steps]
    return max((x for x, _ in pairs), default=0.0), max((theta for _, theta in pairs), default=0.0)


def _relevant(steps: Sequence[_Step]) -> list[_Step]:
    """The steps that `<Z>` depends on: from the first y rotation to the last one."""
    relevant = [step for step in steps if not step.is_identity]
    while relevant and relevant[0].axis == "z":
        relevant.pop(0)
    while relevant and relevant[-1].axis == "z":
        relevant.pop()
    return relevant


def alternating(circuit: Circuit) -> list[Angle]:
    """The circuit as rotations z, y, z, y, ...: their angles, up to global phase.

    Neighbouring rotations about the same axis are added; an axis that is not needed gets angle 0.
    """
    angles: list[Angle] = []
    for gate in circuit.gates:
        for axis, angle in gate.rotations:
            parity = 0 if axis == "z" else 1
            if angles and (len(angles) - 1) % 2 == parity:
                angles[-1] = angles[-1].moderate() + angle.moderate()
                continue
            while len(angles) % 2 != parity:
                angles.append(Angle())
            angles.append(angle.moderate())
    return angles
