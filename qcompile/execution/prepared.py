"""Executables prepared for an executor, and drawing counts from probabilities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.caller import option
from qcompile.errors import CountsError
from qcompile.limits import MAX_SHOTS
from qcompile.passes import Executable


class Binomial(Protocol):
    """A source of counts, one draw per row of a batch; rounding may take p beyond [0, 1]."""

    def binomial(self, n: CircuitShots, p: FloatArray, /) -> CountArray: ...


class Prepared(ABC):
    """An executable prepared for an executor: the work that does not depend on inputs is done.

    `shots_only` says why there are no expectations without shot noise; it is empty if there are, in
    an `ExactPrepared`.
    """

    shots_only: tuple[str, ...] = ()

    def __init__(self, executable: Executable):
        self.executable = executable

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.executable!r})"

    @abstractmethod
    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        """The shots with odd parity of each observable, (B, observables), for x (B, inputs).

        Each circuit is run with its `shots`; the parity of one bit is odd where it is 1.

        A sampler runs the largest number of shots of any circuit, and ignores the last shots of
        circuits with fewer. Counts drawn from probabilities use `rng`, by default the generator of
        the executor; samplers and machines do not use it.

        Raises:
            CircuitError: x or theta has the wrong shape.
            CountsError: shots are out of range.
        """


class ExactPrepared(Prepared):
    """An executable whose probabilities are known, so that its counts can be drawn."""

    def __init__(self, executable: Executable, rng: np.random.Generator):
        super().__init__(executable)
        self._rng = rng

    @abstractmethod
    def p_one(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """P(1) of each circuit, (B, circuits), in [0, 1] up to rounding."""

    def expectation(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured `<Z>` of each circuit without shot noise, (B, circuits).

        Raises:
            CircuitError: x or theta has the wrong shape.
        """
        return 1.0 - 2.0 * self.p_one(x, theta)

    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        largest_shots(shots)
        p_one = self.p_one(x, theta)
        if rng is None:
            return draw_ones(self._rng, shots, p_one)
        return rng.binomial(shots, p_one)


def draw_ones(rng: np.random.Generator, shots: CircuitShots, p_one: FloatArray) -> CountArray:
    """The ones in `shots` shots, in the shape of `p_one`: binomial, as nothing is entangled."""
    return rng.binomial(shots, np.minimum(np.maximum(p_one, 0.0), 1.0))


def require_exact(prepared: Prepared) -> ExactPrepared:
    """`prepared`, if it has expectations without shot noise.

    Raises:
        CountsError: it needs shots; the message says why.
    """
    if isinstance(prepared, ExactPrepared):
        return prepared
    raise CountsError(*prepared.shots_only)


def largest_shots(shots: CircuitShots) -> int:
    """The number of shots to run so that each circuit gets its `shots`: the largest of them.

    Raises:
        CountsError: the shots of a circuit are out of range.
    """
    if not isinstance(shots, np.ndarray):
        return check_shots(shots)
    check_shots(int(shots.min()))
    return check_shots(int(shots.max()))


def check_shots(shots: int) -> int:
    """`shots`, if an executor can take them.

    Raises:
        CountsError: shots are not a whole number in [1, MAX_SHOTS].
    """
    is_whole = isinstance(shots, int | np.integer) and not isinstance(shots, bool)
    if not is_whole or not 1 <= shots <= MAX_SHOTS:
        raise CountsError(
            f"{shots!s:.60} shots cannot be run.",
            f"Use 1 to {MAX_SHOTS} shots; 1024 and 8192 are typical.",
            f"For expectations without shot noise use {option('shots')} exact.",
        )
    return shots
