"""The gates a program file may use, by name."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.ir import COUPLINGS, FIXED_GATES, ROTATION_GATES, Angle, Gate
from qcompile.qasm.file_gates import ON_ONE, ON_SEVERAL
from qcompile.qasm.modifiers import Unitary

OTHER_GATES = (*ON_ONE, *ON_SEVERAL)
"""Gates of files besides those of `ir.gate`."""

_OTHERS = {gate.name: gate for gate in OTHER_GATES}

KNOWN_GATES = (*FIXED_GATES, *ROTATION_GATES, *COUPLINGS, *_OTHERS)


def standard(name: str, angles: Sequence[Angle], defined: Sequence[str] = ()) -> Unitary:
    """The gate `name` of a standard include.

    Raises:
        CircuitError: there is no such gate, or the number of angles is wrong. `defined` holds the
            gates defined in the file, so that the hint can suggest them.
    """
    if name in _OTHERS:
        require_count(name, len(_OTHERS[name].parameters), len(angles), "angle")
        return _OTHERS[name].unitary(angles)
    if name not in KNOWN_GATES:
        raise CircuitError(f"Unknown gate {name!r}.", nearest(name, [*KNOWN_GATES, *defined]))
    require_count(name, int(name in ROTATION_GATES), len(angles), "angle")
    if name in ("cx", "cz"):
        return Unitary([Gate(name[1:])], is_standard=True).controlled(1)
    qubits = (0, 1) if name in COUPLINGS else (0,)
    gate = Gate(name, angles[0] if angles else None, qubits)
    return Unitary([gate], len(qubits), is_standard=True)


def require_count(gate: str, needed: int, given: int, what: str) -> None:
    """Raise CircuitError unless `gate` was given as many angles or qubits as it takes."""
    if needed != given:
        plural = "" if needed == 1 else "s"
        raise CircuitError(f"{gate} takes {needed} {what}{plural}, found {given}.")
