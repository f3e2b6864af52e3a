"""The gates a program file may name, as gates of the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Gate

Gates = tuple[Gate, ...]


def _u(theta: Angle, phi: Angle, lam: Angle) -> Gates:
    return Gate("rz", lam), Gate("ry", theta), Gate("rz", phi)


def _r(theta: Angle, phi: Angle) -> Gates:
    return Gate("rz", -phi), Gate("rx", theta), Gate("rz", phi)


_OTHERS: dict[str, tuple[int, Callable[..., Gates]]] = {
    "U": (3, _u),
    "u": (3, _u),
    "u3": (3, _u),
    "u2": (2, lambda phi, lam: _u(Angle(math.pi / 2), phi, lam)),
    "u1": (1, lambda lam: (Gate("p", lam),)),
    "phase": (1, lambda lam: (Gate("p", lam),)),
    "u0": (1, lambda _: (Gate("id"),)),
    "r": (2, _r),
}
"""Name to the number of angles and a function from them to gates; equal up to global phase."""

KNOWN_GATES = (*FIXED_GATES, *ROTATION_GATES, *_OTHERS)

ENTANGLING_GATES = frozenset(
    """
    CX cx cy cz ch cp cphase cs csdg csx csxdg crx cry crz cu cu1 cu3 swap iswap iswapdg dcx ecr
    rxx ryy rzz rzx rxy xx_plus_yy xx_minus_yy ms ccx ccz cswap rccx c3x c3sqrtx rc3x rcccx c4x
    mcx mcp
    """.split()  # noqa: SIM905
)

_INVERSE = {"s": "sdg", "t": "tdg", "sx": "sxdg"}
_INVERSE |= {inverse: name for name, inverse in _INVERSE.items()}


def standard(name: str, angles: Sequence[Angle], defined: Sequence[str] = ()) -> Gates:
    """The gate `name` of a standard include, up to global phase; the first gate acts first.

    Raises:
        CircuitError: no such gate, or another number of angles. `defined` holds the file's own
            gates, so that advice can name them.
    """
    if name in _OTHERS:
        needed, make = _OTHERS[name]
    elif name in KNOWN_GATES:
        needed, make = int(name in ROTATION_GATES), lambda *angle: (Gate(name, *angle),)
    else:
        raise CircuitError(f"Unknown gate {name!r}.", nearest(name, [*KNOWN_GATES, *defined]))
    require_count(name, needed, len(angles), "angle")
    return make(*angles)


def require_count(gate: str, needed: int, found: int, what: str) -> None:
    """Raise CircuitError unless `gate` was given as many angles or qubits as it takes."""
    if needed != found:
        plural = "" if needed == 1 else "s"
        raise CircuitError(f"{gate} takes {needed} {what}{plural}, found {found}.")


def inverse(gates: Sequence[Gate]) -> list[Gate]:
    """The gates that undo `gates`."""
    return [
        Gate(_INVERSE.get(gate.name, gate.name), gate.angle and -gate.angle)
        for gate in reversed(gates)
    ]
