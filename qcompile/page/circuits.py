"""The circuits of a policy in a report: one of each shape, before and after compilation."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.noise import REFERENCE_SHOTS, expected_error
from qcompile.page.document import Block, Code, Heading, Picture, Prose, Qubits, Section, Tile
from qcompile.passes import LEVELS, Executable, compile
from qcompile.policy import AnyPolicy, Network, Policy
from qcompile.report.placement import left_out, perfect_error
from qcompile.report.tables import plural
from qcompile.report.wires import angle_words

_MOST_LETTERS = 200_000
"""A longer drawing is of the first circuit alone."""
_MOST_NUMBERS = 12
_MOST_TILES = 400
_WARM = 2.0
"""A qubit whose error is that much above a perfect one's, as a share of it, has the full colour."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """A policy, compiled for a device as it was played.

    `calibration` is that of a twin. A `backend` has a name of its own where it is not the device's.
    Errors of qubits are stated at `shots`; None stands for several numbers of shots, and for exact
    expectations.
    """

    policy: AnyPolicy
    device: Device
    level: int = 2
    copies: int = 1
    calibration: Calibration | None = None
    backend: str = ""
    shots: int | None = None

    @property
    def name(self) -> str:
        """What it was played on; different backends of one device have different names."""
        return self.backend or self.device.name

    def executable(self) -> Executable | None:
        """The circuits, trained numbers as symbols; None for a network."""
        if not isinstance(self.policy, Policy):
            return None
        policy = self.policy
        return compile(
            policy.program, self.device, self.level, policy.importance, copies=self.copies
        )


def circuits_section(compiled: Sequence[Compiled]) -> Section:
    """The shapes of every policy's circuits, before and after compilation."""
    blocks: list[Block] = []
    policies = {id(one.policy): one.policy for one in compiled}
    for policy in policies.values():
        if len(policies) > 1:
            blocks.append(Heading(policy.name))
        if isinstance(policy, Network):
            blocks.append(Prose("A network: it has no circuits, so nothing is compiled."))
            continue
        seen = set()
        for one in compiled:
            made = (one.device.native.gates, one.level)
            if one.policy is policy and made not in seen:
                seen.add(made)
                alone = Compiled(policy, one.device, one.level).executable()
                blocks += [] if alone is None else _drawing(one, alone)
    return Section("Circuits", blocks)


def _drawing(compiled: Compiled, executable: Executable) -> Iterator[Block]:
    circuits, level = len(executable.source), compiled.level
    gates = " ".join(compiled.device.native.gates)
    count = plural(circuits, "circuit")
    yield Prose(f"{count}, compiled to {gates}. Level {level}: {LEVELS[level]}.")
    if executable.source.has_products:
        yield Code("Before compilation", str(executable.source))
        yield Code(f"For {compiled.device.name}, level {level}", str(executable.native))
        return
    shown = None
    drawing = executable.draw("svg")
    if len(drawing) > _MOST_LETTERS:
        shown, drawing = 0, executable.draw("svg", 0)
    yield Picture(
        f"Circuits for {compiled.device.name}, level {level}: before and after compilation",
        drawing,
        text=" ".join(
            [
                *["The first circuit alone: `qcompile show` prints them all."] * (shown == 0),
                *angle_words(executable),
            ]
        ),
        spoken=executable.draw("text", shown),
    )


def _numbers(numbers: Sequence[int]) -> str:
    """0 to 23, or 0, 2, 4: at most _MOST_NUMBERS of them."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]} to {numbers[-1]}"
    words = ", ".join(map(str, numbers[:_MOST_NUMBERS]))
    more = len(numbers) - _MOST_NUMBERS
    return f"{words} and {more} more" if more > 0 else words


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
    device = compiled.device
    circuits: dict[int, list[int]] = {}
    count = len(executable.native) // compiled.copies
    owners = np.repeat(np.arange(len(executable.native)), executable.native.widths).tolist()
    for index, qubit in zip(owners, executable.qubits.tolist(), strict=True):
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
    yield Qubits(
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
