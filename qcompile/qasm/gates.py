"""The gates a program file may use, as gates of the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Gate

Gates = tuple[Gate, ...]


@dataclass(frozen=True)
class FileGate:
    """A gate that files use: its parameters, its meaning, and its gates of the table.

    `meaning` is the text for the documentation; the gates are equal to it up to the global phase
    `phase`, which powers depend on.
    """

    name: str
    parameters: tuple[str, ...]
    meaning: str
    make: Callable[..., Gates]
    phase: Callable[..., Angle] = lambda *_: Angle()


def _alias(name: str, of: str) -> FileGate:
    parameters = ("a",) if of in ROTATION_GATES else ()
    meaning = f"{of}({', '.join(parameters)})" if parameters else of
    return FileGate(name, parameters, meaning, lambda *angle: (Gate(of, *angle),))


def _u(theta: Angle, phi: Angle, lam: Angle) -> Gates:
    return Gate("rz", lam), Gate("ry", theta), Gate("rz", phi)


def _half_sum(*angles: Angle) -> Angle:
    return (angles[-2] + angles[-1]) * 0.5


def _r(theta: Angle, phi: Angle) -> Gates:
    return Gate("rz", -phi), Gate("rx", theta), Gate("rz", phi)


_PI, _HALF_PI = Angle(math.pi), Angle(math.pi / 2)
_U = "rz(lambda), then ry(theta), then rz(phi)"
_R = "a rotation by theta about the axis cos(phi) x + sin(phi) y"

OTHER_GATES = (
    *(FileGate(name, ("theta", "phi", "lambda"), _U, _u, _half_sum) for name in ("U", "u", "u3")),
    FileGate(
        "u2", ("phi", "lambda"), "u(pi/2, phi, lambda)", lambda *a: _u(_HALF_PI, *a), _half_sum
    ),
    _alias("u1", "p"),
    _alias("phase", "p"),
    FileGate("u0", ("a",), "id", lambda _: (Gate("id"),)),
    FileGate("gphase", ("a",), "a global phase: no gate", lambda _: ()),
    *(FileGate(name, ("theta", "phi"), _R, _r) for name in ("r", "prx", "U1q")),
    FileGate("gpi", ("phi",), "r(pi, phi)", lambda phi: _r(_PI, phi), lambda _: _HALF_PI),
    FileGate("gpi2", ("phi",), "r(pi/2, phi)", lambda phi: _r(_HALF_PI, phi)),
    _alias("i", "id"),
    _alias("v", "sx"),
    _alias("vi", "sxdg"),
    _alias("si", "sdg"),
    _alias("ti", "tdg"),
    _alias("phaseshift", "p"),
    _alias("Rz", "rz"),
)
"""Gates of files besides those of `ir.gate`: from the OpenQASM standard and Qiskit, Braket (prx,
gpi, gpi2, i, v, ...; angles in radians) and Quantinuum (U1q, Rz)."""

_OTHERS = {gate.name: gate for gate in OTHER_GATES}

KNOWN_GATES = (*FIXED_GATES, *ROTATION_GATES, *_OTHERS)

ENTANGLING_GATES = frozenset(
    """
    CX cx cy cz ch cp cphase cs csdg csx csxdg crx cry crz cu cu1 cu3 swap iswap iswapdg dcx ecr
    rxx ryy rzz rzx rxy xx_plus_yy xx_minus_yy ms ccx ccz cswap rccx c3x c3sqrtx rc3x rcccx c4x
    mcx mcp cnot ccnot cv cphaseshift cphaseshift00 cphaseshift01 cphaseshift10 pswap xx yy zz xy
    ZZ RZZ Rxxyyzz Rxxyyzz_zphase
    """.split()  # noqa: SIM905
)


def standard(name: str, angles: Sequence[Angle], defined: Sequence[str] = ()) -> Gates:
    """The gate `name` of a standard include, up to global phase; the first gate acts first.

    Raises:
        CircuitError: there is no such gate, or the number of angles is wrong. `defined` holds the
            gates defined in the file, so that the hint can suggest them.
    """
    if name in _OTHERS:
        gate = _OTHERS[name]
        require_count(name, len(gate.parameters), len(angles), "angle")
        return gate.make(*angles)
    if name not in KNOWN_GATES:
        raise CircuitError(f"Unknown gate {name!r}.", nearest(name, [*KNOWN_GATES, *defined]))
    require_count(name, int(name in ROTATION_GATES), len(angles), "angle")
    return (Gate(name, angles[0] if angles else None),)


def lacking_phase(name: str, angles: Sequence[Angle]) -> Angle:
    """The global phase by which the gates of `standard` differ from gate `name`."""
    return _OTHERS[name].phase(*angles) if name in _OTHERS else Angle()


def require_count(gate: str, needed: int, given: int, what: str) -> None:
    """Raise CircuitError unless `gate` was given as many angles or qubits as it takes."""
    if needed != given:
        plural = "" if needed == 1 else "s"
        raise CircuitError(f"{gate} takes {needed} {what}{plural}, found {given}.")
