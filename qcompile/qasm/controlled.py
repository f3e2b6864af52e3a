"""Gates under any number of controls, exactly, in cx, cz and one-qubit gates.

Only the middle of a sequence A B A^-1 needs controls. A rotation is halved around two controlled x.
A phase where all qubits are 1 is a sum over the parities of their subsets, each on one qubit in
turn; x and z are such phases between h. Source: Barenco et al., arXiv:quant-ph/9503016, sections 5
and 7.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from qcompile.ir import Angle, Gate

Qubits = tuple[int, ...]

_QUARTER_PI, _HALF_PI, _PI = Angle(math.pi / 4), Angle(math.pi / 2), Angle(math.pi)
_PHASES = {
    "s": _HALF_PI,
    "sdg": -_HALF_PI,
    "t": _QUARTER_PI,
    "tdg": -_QUARTER_PI,
    "sx": _HALF_PI,
    "sxdg": -_HALF_PI,
}
"""The angle a of gates equal to p(a), or to h p(a) h."""
_AROUND = {
    "y": (("sdg", None), ("s", None)),
    "h": (("ry", -_QUARTER_PI), ("ry", _QUARTER_PI)),
    "sx": (("h", None), ("h", None)),
    "sxdg": (("h", None), ("h", None)),
    "rx": (("h", None), ("h", None)),
}
"""What stands before and after x, z, p and rz in gates that are equal to these but for a basis."""

_INVERSE = {"s": "sdg", "t": "tdg", "sx": "sxdg"}
_INVERSE |= {inverse: name for name, inverse in _INVERSE.items()}


def inverse(gates: Sequence[Gate]) -> list[Gate]:
    """The gates that undo `gates`."""
    return [
        Gate(_INVERSE.get(gate.name, gate.name), gate.angle and -gate.angle, gate.qubits)
        for gate in reversed(gates)
    ]


def conjugated(gates: Sequence[Gate]) -> int:
    """How many gates at the start are undone at the end, so that the rest stands between them."""
    count = 0
    while 2 * count + 2 < len(gates) and [gates[-1 - count]] == inverse([gates[count]]):
        count += 1
    return count


def controlled(gates: Sequence[Gate], phase: Angle, controls: int) -> Iterator[Gate]:
    """The gates and the global phase, applied if qubits 0 to `controls` - 1 are all 1.

    The qubits of `gates` come after the controls. No phase is lacking. There are at least
    2**(controls - 1) gates, unless there is nothing to apply.
    """
    on = tuple(range(controls))
    yield from _sequence([gate.on(*(q + controls for q in gate.qubits)) for gate in gates], on)
    if phase != Angle():
        yield from _phase(phase, on)


def _sequence(gates: Sequence[Gate], on: Qubits) -> Iterator[Gate]:
    outer = conjugated(gates)
    inner = gates[outer : len(gates) - outer]
    yield from gates[:outer]
    position = 0
    while position < len(inner):
        three = inner[position : position + 3]
        if [gate.name for gate in three] == ["rz", "ry", "rz"] and len({*_qubits(three)}) == 1:
            yield from _euler(three, on)
            position += 3
        else:
            yield from _one(inner[position], on)
            position += 1
    yield from gates[len(gates) - outer :]


def _qubits(gates: Sequence[Gate]) -> Iterator[int]:
    return (qubit for gate in gates for qubit in gate.qubits)


def _euler(gates: Sequence[Gate], on: Qubits) -> Iterator[Gate]:
    """Rz, ry and rz in halves that cancel, unless the controlled x between them turn them over."""
    first, polar, last = (gate.angle or Angle() for gate in gates)
    (target,) = gates[0].qubits
    yield Gate("rz", (first - last) / 2, (target,))
    yield from _x(on, target)
    yield Gate("rz", (first + last) / -2, (target,))
    yield Gate("ry", polar / -2, (target,))
    yield from _x(on, target)
    yield Gate("ry", polar / 2, (target,))
    yield Gate("rz", last, (target,))


def _one(gate: Gate, on: Qubits) -> Iterator[Gate]:
    name, target, angle = gate.name, gate.qubits[-1], gate.angle or Angle()
    if name == "ecr":
        yield from _sequence(_echoed(*gate.qubits), on)
        return
    on = (*on, *gate.qubits[:-1])
    around = _AROUND.get(name)
    if around:
        yield Gate(*around[0], (target,))
    match name:
        case "id":
            yield gate
        case "x" | "y" | "cx":
            yield from _x(on, target)
        case "z" | "h" | "cz":
            yield from _z(on, target)
        case "rx" | "ry" | "rz":
            for half in (angle / 2, angle / -2):
                yield Gate("ry" if name == "ry" else "rz", half, (target,))
                yield from _x(on, target)
        case _:
            yield from _phase(_PHASES.get(name, angle), (*on, target))
    if around:
        yield Gate(*around[1], (target,))


def _echoed(control: int, target: int) -> list[Gate]:
    """Ecr, phase included: exp(-i pi/4 Z X), then x on the control."""
    around = [Gate("h", None, (target,)), Gate("cx", None, (control, target))]
    return [*around, Gate("rz", _HALF_PI, (target,)), *around[::-1], Gate("x", None, (control,))]


def _x(on: Qubits, target: int) -> Iterator[Gate]:
    if len(on) == 1:
        yield Gate("cx", None, (*on, target))
        return
    yield Gate("h", None, (target,))
    yield from _phase(_PI, (*on, target))
    yield Gate("h", None, (target,))


def _z(on: Qubits, target: int) -> Iterator[Gate]:
    if len(on) == 1:
        yield Gate("cz", None, (*on, target))
    else:
        yield from _phase(_PI, (*on, target))


def _phase(angle: Angle, qubits: Qubits) -> Iterator[Gate]:
    """The phase `angle` where all n qubits are 1, in 2**n - 2 cx.

    The product of n bits is the sum of the parities of their subsets, the even ones with a minus,
    over 2**(n - 1). The parities whose last qubit is k pass over qubit k in the order of a Gray
    code, so that one cx leads to the next.
    """
    share = angle / 2 ** (len(qubits) - 1)
    for last, qubit in enumerate(qubits):
        for number in range(2**last):
            is_even = (number ^ number >> 1).bit_count() % 2
            yield Gate("p", -share if is_even else share, (qubit,))
            if last:
                changed = min((number + 1 & ~number).bit_length(), last) - 1
                yield Gate("cx", None, (qubits[changed], qubit))
