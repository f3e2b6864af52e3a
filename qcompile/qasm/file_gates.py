"""The gates of files besides those of `ir.gate`, in gates of that table.

They are from the OpenQASM standard and Qiskit, from Braket (prx, gpi, i, v, cphaseshift00, xx, ...;
angles in radians) and Quantinuum (U1q, Rz, ZZ, RZZ, Rxxyyzz).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from qcompile.ir import ROTATION_GATES, Angle, Gate
from qcompile.qasm.modifiers import Unitary

Gates = tuple[Gate, ...]


@dataclass(frozen=True)
class FileGate:
    """A gate that files use: its parameters, its meaning, and its gates of the table.

    `meaning` is the text for the documentation. The gates, on qubits 0 to `qubits` - 1, are equal
    to it up to the global phase `phase`, on which powers and controls depend. With `controls`, they
    are what these control, which come first.
    """

    name: str
    parameters: tuple[str, ...]
    meaning: str
    make: Callable[..., Gates]
    phase: Callable[..., Angle] = lambda *_: Angle()
    qubits: int = 1
    controls: int = 0

    def unitary(self, angles: Sequence[Angle]) -> Unitary:
        """The gate with these angles, one for each parameter."""
        gates, phase = self.make(*angles), self.phase(*angles)
        unitary = Unitary(gates, self.qubits, phase, is_standard=True)
        return unitary.controlled(self.controls) if self.controls else unitary


def _alias(name: str, of: str) -> FileGate:
    return FileGate(name, _angle_of(of), _call(of), lambda *angle: (Gate(of, *angle),))


def _angle_of(name: str) -> tuple[str, ...]:
    return ("a",) if name in ROTATION_GATES else ()


def _call(name: str) -> str:
    return f"{name}(a)" if name in ROTATION_GATES else name


def _u(theta: Angle, phi: Angle, lam: Angle) -> Gates:
    return Gate("rz", lam), Gate("ry", theta), Gate("rz", phi)


def _half_sum(theta: Angle, phi: Angle, lam: Angle) -> Angle:
    return (phi + lam) * 0.5


def _r(theta: Angle, phi: Angle) -> Gates:
    return Gate("rz", -phi), Gate("rx", theta), Gate("rz", phi)


_PI, _HALF_PI = Angle(math.pi), Angle(math.pi / 2)
_ANGLES = ("theta", "phi", "lambda")
_U = "rz(lambda), then ry(theta), then rz(phi)"
_R = "a rotation by theta about the axis cos(phi) x + sin(phi) y"

ON_ONE = (
    *(FileGate(name, _ANGLES, _U, _u, _half_sum) for name in ("U", "u", "u3")),
    FileGate(
        "u2",
        ("phi", "lambda"),
        "u(pi/2, phi, lambda)",
        lambda *a: _u(_HALF_PI, *a),
        lambda *a: _half_sum(_HALF_PI, *a),
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


def _on(text: str, *angles: Angle) -> Gates:
    """The gates of a text such as "h0 cx01 rz1", which names qubits; `angles` for its rotations."""
    given = iter(angles)
    gates = []
    for word in text.split():
        name = word.rstrip("0123")
        angle = next(given) if name in ROTATION_GATES else None
        gates.append(Gate(name, angle, tuple(map(int, word[len(name) :]))))
    return tuple(gates)


def _on_two(name: str, meaning: str, text: str, *parameters: str) -> FileGate:
    """A gate with the text of `_on`, whose rotations have the parameters in order."""
    return FileGate(name, parameters, meaning, lambda *angles: _on(text, *angles), qubits=2)


def _controlled(name: str, of: str, controls: int = 1) -> FileGate:
    words = "ctrl" if controls == 1 else f"ctrl({controls})"
    return FileGate(
        name,
        _angle_of(of),
        f"{words} @ {_call(of)}",
        lambda *angle: (Gate(of, *angle),),
        controls=controls,
    )


_SWAP = "cx01 cx10 cx01"
_XX, _YY = "h0 h1 cx01 rz1 cx01 h1 h0", "sx0 sx1 cx01 rz1 cx01 sxdg1 sxdg0"
_ZZ, _ZX = "cx01 rz1 cx01", "h1 cx01 rz1 cx01 h1"
_XX_YY = "sx0 sx1 cx01 rx0 rz1 cx01 sxdg1 sxdg0"
"""Between its ends XX is X of the first qubit, and YY is Z of the second."""
_RCCX = "h2 t2 cx12 tdg2 cx02 t2 cx12 tdg2 h2"
_RC3X = "h3 t3 cx23 tdg3 h3 cx03 t3 cx13 tdg3 cx03 t3 cx13 tdg3 h3 t3 cx23 tdg3 h3"


def _xx_plus_yy(theta: Angle, beta: Angle) -> Gates:
    return _on(f"rz0 {_XX_YY} rz0", beta, theta / 2, theta / 2, -beta)


def _xx_minus_yy(theta: Angle, beta: Angle) -> Gates:
    return _on(f"rz1 {_XX_YY} rz1", -beta, theta / 2, theta / -2, beta)


def _ms(first: Angle, second: Angle, theta: Angle) -> Gates:
    return _on(f"rz0 rz1 {_XX} rz1 rz0", -first, -second, theta, second, first)


def _phase_where(flipped: str) -> Callable[[Angle], Gates]:
    """A phase where both qubits are 1 between x on the qubits of `flipped`."""
    text = f"{flipped} p0 p1 cx01 p1 cx01 {flipped}"
    return lambda a: _on(text, a / 2, a / 2, a / -2)


_TWO_ANGLES = ("theta", "beta")

ON_SEVERAL = (
    *(_controlled(name, "x") for name in ("CX", "cnot")),
    _controlled("cy", "y"),
    _controlled("ch", "h"),
    _controlled("cs", "s"),
    _controlled("csdg", "sdg"),
    *(_controlled(name, "sx") for name in ("csx", "cv")),
    _controlled("csxdg", "sxdg"),
    _controlled("crx", "rx"),
    _controlled("cry", "ry"),
    _controlled("crz", "rz"),
    *(_controlled(name, "p") for name in ("cp", "cphase", "cphaseshift", "cu1")),
    FileGate("cu3", _ANGLES, "ctrl @ u(theta, phi, lambda)", _u, _half_sum, controls=1),
    FileGate(
        "cu",
        (*_ANGLES, "gamma"),
        "cu3(theta, phi, lambda), and p(gamma) on the control",
        lambda *angles: _u(*angles[:3]),
        lambda *angles: _half_sum(*angles[:3]) + angles[3],
        controls=1,
    ),
    *(_controlled(name, "x", 2) for name in ("ccx", "ccnot")),
    _controlled("ccz", "z", 2),
    _controlled("c3x", "x", 3),
    _controlled("c3sqrtx", "sx", 3),
    _controlled("c4x", "x", 4),
    _on_two("swap", "exchanges its qubits", _SWAP),
    FileGate("cswap", (), "ctrl @ swap", lambda: _on(_SWAP), qubits=2, controls=1),
    FileGate(
        "iswap", (), "xx_plus_yy(-pi, 0)", lambda: _on(_XX_YY, -_HALF_PI, -_HALF_PI), qubits=2
    ),
    FileGate("iswapdg", (), "xx_plus_yy(pi, 0)", lambda: _on(_XX_YY, _HALF_PI, _HALF_PI), qubits=2),
    _on_two("dcx", "cx q, r, then cx r, q", "cx01 cx10"),
    _on_two("pswap", "swap, with a phase a where the qubits differ", "cx01 cx10 p1 cx01", "a"),
    *(_on_two(name, "exp(-i a/2 XX)", _XX, "a") for name in ("rxx", "xx")),
    *(_on_two(name, "exp(-i a/2 YY)", _YY, "a") for name in ("ryy", "yy")),
    *(_on_two(name, "exp(-i a/2 ZZ)", _ZZ, "a") for name in ("rzz", "zz", "RZZ")),
    FileGate("ZZ", (), "rzz(pi/2)", lambda: _on(_ZZ, _HALF_PI), qubits=2),
    _on_two("rzx", "exp(-i a/2 Z X), Z on the first qubit", _ZX, "a"),
    FileGate("xy", ("a",), "xx_plus_yy(-a, 0)", lambda a: _on(_XX_YY, a / -2, a / -2), qubits=2),
    FileGate(
        "xx_plus_yy",
        _TWO_ANGLES,
        "exp(-i theta/4 (XX + YY)) between rz(beta) and rz(-beta) on the first qubit",
        _xx_plus_yy,
        qubits=2,
    ),
    FileGate(
        "xx_minus_yy",
        _TWO_ANGLES,
        "exp(-i theta/4 (XX - YY)) between rz(-beta) and rz(beta) on the second qubit",
        _xx_minus_yy,
        qubits=2,
    ),
    FileGate(
        "Rxxyyzz",
        ("a", "b", "c"),
        "rxx(a), ryy(b) and rzz(c)",
        lambda *angles: _on(f"{_XX} {_YY} {_ZZ}", *angles),
        qubits=2,
    ),
    FileGate(
        "ms",
        ("phi0", "phi1", "theta"),
        "rxx(theta), its axes turned by phi0 and phi1 about z",
        _ms,
        qubits=2,
    ),
    FileGate(
        "cphaseshift00", ("a",), "p(a) where both qubits are 0", _phase_where("x0 x1"), qubits=2
    ),
    FileGate(
        "cphaseshift01", ("a",), "a phase a where the qubits are 0, 1", _phase_where("x0"), qubits=2
    ),
    FileGate(
        "cphaseshift10", ("a",), "a phase a where the qubits are 1, 0", _phase_where("x1"), qubits=2
    ),
    FileGate("rccx", (), "ccx, with other phases", lambda: _on(_RCCX), qubits=3),
    *(
        FileGate(name, (), "c3x, with other phases", lambda: _on(_RC3X), qubits=4)
        for name in ("rc3x", "rcccx")
    ),
)
"""Gates on several qubits. Sources: qelib1.inc, qiskit.circuit.library, hqslib1.inc."""
