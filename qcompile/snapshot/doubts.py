"""Values of a calibration that look wrong: kept, and flagged."""

from __future__ import annotations

import statistics
from collections.abc import Collection, Iterator, Sequence

from qcompile.device import Qubit
from qcompile.noise.channels import relaxation_error

USUAL_SX_NS = 320 / 9
"""160 samples of 2/9 ns: the sx duration on IBM's Falcon processors."""

_MAX_READOUT_ERROR = 0.1
_MAX_GATE_ERROR = 0.01
_MAX_SX_NS = 200.0


def implausible_values(qubit: Qubit) -> Iterator[str]:
    """What looks wrong about a qubit, in words."""
    readout_error = (qubit.p10 + qubit.p01) / 2
    if readout_error > _MAX_READOUT_ERROR:
        yield f"readout error {readout_error:.3g} is above {_MAX_READOUT_ERROR}"
    if qubit.t2_us > 2 * qubit.t1_us:
        yield f"T2 {qubit.t2_us:.4g} us is above 2 T1 = {2 * qubit.t1_us:.4g} us"
    for name, gate in qubit.gates.items():
        if name == "sx" and gate.length_ns > _MAX_SX_NS:
            yield f"sx length {gate.length_ns:.4g} ns is above {_MAX_SX_NS:.0f} ns"
        if gate.error > _MAX_GATE_ERROR:
            yield f"{name} error {gate.error:.3g} is above {_MAX_GATE_ERROR}"
        least = relaxation_error(qubit, gate.length_ns)
        if gate.error < least:
            yield f"{name} error {gate.error:.3g} is below the {least:.3g} of relaxation alone"


def notes_on(qubits: Sequence[Qubit], left_out: Collection[int]) -> Iterator[str]:
    """What looks wrong about many qubits, in words."""
    lengths = [q.gates["sx"].length_ns for q in qubits if "sx" in q.gates]
    if lengths and (median := statistics.median(lengths)) > _MAX_SX_NS:
        yield (
            f"Durations look wrong: the median sx takes {median:.4g} ns, "
            f"{median / USUAL_SX_NS:.3g} times the usual {USUAL_SX_NS:.4g} ns."
        )
    unreadable = [
        i
        for i, q in enumerate(qubits)
        if i not in left_out and (q.p10 + q.p01) / 2 > _MAX_READOUT_ERROR
    ]
    if unreadable:
        yield (
            f"{len(unreadable)} of {len(qubits)} qubits have a readout error above "
            f"{_MAX_READOUT_ERROR}: {', '.join(map(str, unreadable))}."
        )
