"""Where the circuits of a report are placed: the map of the device, and its qubits as tiles."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence

from qcompile.device import Device
from qcompile.noise import REFERENCE_SHOTS, expected_error
from qcompile.page.circuits import Compiled
from qcompile.page.document import STYLE, Block, Picture, Qubits, Section, Table, Tile
from qcompile.passes import Executable
from qcompile.report.device_map import draw_map
from qcompile.report.placement import left_out, perfect_error
from qcompile.report.tables import plural
from qcompile.report.usage import Usage

_MOST_NUMBERS = 12
_MOST_TILES, _MOST_BESIDE_MAP = 400, 30
_WARM = 2.0
"""A qubit whose error is that much above a perfect one's, as a share of it, has the full colour."""
_WARM_READOUT = 0.1
"""A readout error of that much has the full colour."""


def placement_section(compiled: Sequence[Compiled]) -> Section:
    """The qubits of each device that has any, with the circuits that are placed on them."""
    blocks: list[Block] = []
    seen = set()
    placed = [one for one in compiled if not one.device.is_ideal]
    policies = len({id(one.policy) for one in placed})
    for one in placed:
        executable = one.executable()
        key = (id(one.policy), one.name)
        if executable is None or key in seen:
            continue
        seen.add(key)
        name = f"{one.policy.name} on {one.name}" if policies > 1 else one.name
        blocks += _placement(one, executable, name)
    return Section("Placement", blocks)


def _placement(compiled: Compiled, executable: Executable, name: str) -> Iterator[Block]:
    if compiled.device.couplings:
        yield _map(compiled.device, Usage.of(executable), name)
    if executable.source.is_wide:
        yield from _wide_placement(compiled, executable, name)
    else:
        yield _narrow_placement(compiled, executable, name)


def _map(device: Device, used: Usage, name: str) -> Picture:
    """The qubits and couplings of a device, and those that are used."""
    wide = draw_map(device, used, "", STYLE)
    narrow = draw_map(device, used, "", narrow=True)
    couplings = [f"{low} and {high}" for low, high in used.pairs]
    words = f"In use: {plural(len(used.bits), 'qubit')}, {', '.join(map(str, sorted(used.bits)))}"
    words += f"; {plural(len(couplings), 'coupling')}, {', '.join(couplings)}" if couplings else ""
    return Picture(f"Map of {name}", wide.svg(), narrow.svg(), f"{words}.")


def _wide_placement(compiled: Compiled, executable: Executable, name: str) -> Iterator[Block]:
    """The qubits with their bits, and the couplings in use with their errors."""
    device, used = compiled.device, Usage.of(executable)
    reasons = left_out(device, compiled.calibration)
    is_small = len(device.qubits) <= _MOST_BESIDE_MAP
    shown = range(len(device.qubits)) if is_small else sorted(used.bits)
    errors = [(qubit.p10 + qubit.p01) / 2 for qubit in device.qubits]
    tiles = [
        Tile(
            qubit,
            f"{100 * errors[qubit]:.2f} %",
            min(errors[qubit] / _WARM_READOUT, 1.0),
            _bits(used.bits[qubit]) if qubit in used.bits else "",
            reasons.get(qubit, ""),
        )
        for qubit in shown
    ]
    count = plural(len(executable.source), "circuit")
    yield Qubits(
        f"Qubits of {name}" + " in use" * (not is_small),
        tiles,
        f"{count} in {plural(executable.round_count, 'round')}. The number beside a qubit is its "
        "readout error, the mean of p10 and p01.",
    )
    rows = []
    for (gate, *pair), number in sorted(used.gates.items(), key=lambda item: item[0][1:]):
        found = device.coupling_calibrations[gate, pair[0], pair[1]]
        error, length = f"{100 * found.error:.2f} %", f"{found.length_ns:.0f}"
        rows.append([f"{pair[0]}, {pair[1]}", gate, error, length, str(number)])
    if rows:
        columns = ["control, target", "gate", "error", "length, ns", "times in the circuits"]
        yield Table(f"Couplings of {name} in use", columns, rows)


def _bits(bits: Sequence[int]) -> str:
    if not bits:
        return "for routing"
    return f"{'bit' if len(bits) == 1 else 'bits'} {_numbers(bits)}"


def _narrow_placement(compiled: Compiled, executable: Executable, name: str) -> Qubits:
    """The qubits, each with its circuits and its error of `<Z>`."""
    device = compiled.device
    circuits: dict[int, list[int]] = {}
    count = len(executable.native) // compiled.copies
    for index, qubit in enumerate(executable.qubits.tolist()):
        circuits.setdefault(qubit, []).append(index % count)
    shots = compiled.shots or REFERENCE_SHOTS
    errors = [expected_error(device, qubit, shots) for qubit in range(len(device.qubits))]
    perfect = perfect_error(shots)
    reasons = left_out(device, compiled.calibration)
    shown = sorted(circuits) if len(errors) > _MOST_TILES else range(len(errors))
    tiles = [
        Tile(
            qubit,
            "unknown" if (error := errors[qubit]) is None else f"{error:.4f}",
            1.0 if error is None else min(max((error / perfect - 1) / _WARM, 0.0), 1.0),
            _placed(circuits.get(qubit, [])),
            reasons.get(qubit, ""),
        )
        for qubit in shown
    ]
    rounds = plural(executable.round_count, "round")
    side = f", {compiled.copies} copies side by side" if compiled.copies > 1 else ""
    return Qubits(
        f"Qubits of {name}",
        tiles,
        f"{plural(count, 'circuit')}{side} in {rounds}{_ranking(device, reasons, shots)}. The "
        f"number beside a qubit is its error of <Z>: root mean square at {plural(shots, 'shot')}, "
        f"readout mitigated; {perfect:.4f} if perfect.",
    )


def _ranking(device: Device, reasons: Container[int], shots: int) -> str:
    """What the placement followed, where some of the qubits are better than others."""
    errors = {expected_error(device, q) for q in range(len(device.qubits)) if q not in reasons}
    if len(errors) < 2:
        return ""
    at = f", ranked at {REFERENCE_SHOTS} shots" if shots != REFERENCE_SHOTS else ""
    return f"; the circuits that matter most are on the best qubits{at}"


def _placed(numbers: Sequence[int]) -> str:
    if not numbers:
        return ""
    distinct = sorted(set(numbers))
    word = "circuit" if len(distinct) == 1 else "circuits"
    return f"{word} {_numbers(distinct)}"


def _numbers(numbers: Sequence[int]) -> str:
    """0 to 23, or 0, 2, 4: at most _MOST_NUMBERS of them."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]} to {numbers[-1]}"
    words = ", ".join(map(str, numbers[:_MOST_NUMBERS]))
    more = len(numbers) - _MOST_NUMBERS
    return f"{words} and {more} more" if more > 0 else words
