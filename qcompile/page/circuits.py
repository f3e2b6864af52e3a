"""The circuits of a policy in a report: one of each shape, before and after compilation."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

from qcompile.device import Device
from qcompile.ir import Program
from qcompile.noise import REFERENCE_SHOTS, expected_error, unusable
from qcompile.page.document import Block, Code, Heading, Prose, Qubits, Section, Tile
from qcompile.passes import LEVELS, Executable, compile
from qcompile.policy import AnyPolicy, Network, Policy
from qcompile.report.drawing.diagram import shape
from qcompile.report.placement import PERFECT
from qcompile.report.tables import plural
from qcompile.report.wires import wire

_MOST_SHAPES = 6
_MOST_NUMBERS = 12
_MOST_TILES = 400
_WARM = 2.0
"""A qubit whose error is that much above a perfect one's, as a share of it, has the full colour."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """A policy, compiled for a device as it was played."""

    policy: AnyPolicy
    device: Device
    level: int = 2
    copies: int = 1

    def executable(self) -> Executable | None:
        """The circuits, trained numbers as symbols; None for a network."""
        if not isinstance(self.policy, Policy):
            return None
        policy = self.policy
        return compile(
            policy.program, self.device, self.level, policy.importance, copies=self.copies
        )


def shapes(program: Program) -> list[list[int]]:
    """The circuits of each shape by their numbers, in order of first use.

    Circuits have one shape where they differ by the numbers and symbols of their angles alone.
    """
    found: dict[Hashable, list[int]] = {}
    for index, circuit in enumerate(program.circuits):
        found.setdefault(shape(program, circuit), []).append(index)
    return [*found.values()]


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
                blocks += _drawings(one, titled=len(seen) > 1)
    return Section("Circuits", blocks)


def _drawings(compiled: Compiled, *, titled: bool) -> Iterator[Block]:
    executable = Compiled(compiled.policy, compiled.device, compiled.level).executable()
    if executable is None:
        return
    before, after = executable.source.circuits, executable.native.circuits
    groups = shapes(executable.source)
    gates = " ".join(compiled.device.native.gates)
    words = (
        f"{plural(len(before), 'circuit')} of {plural(len(groups), 'shape')}, compiled to {gates} "
        f"at level {compiled.level}: {LEVELS[compiled.level]}."
    )
    yield Prose(words)
    for group in groups[:_MOST_SHAPES]:
        first = group[0]
        label = f"Circuit {first}" if len(group) == 1 else f"Circuits {_numbers(group)}"
        if titled:
            label += f", for {compiled.device.name}, level {compiled.level}"
        shown = f", circuit {first} shown" if len(group) > 1 else ""
        text = f"before  {wire(before[first])}\nafter   {wire(after[first])}"
        yield Code(f"{label}{shown}", text)
    if len(groups) > _MOST_SHAPES:
        command = "`qcompile show` prints them all"
        yield Prose(f"{plural(len(groups) - _MOST_SHAPES, 'more shape')}: {command}.")
    if executable.native.late_angles:
        yield Code(
            "An angle computed when an observation is bound", str(executable.native.late_angles[0])
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
        key = (id(one.policy), one.device.name)
        if executable is None or key in seen:
            continue
        seen.add(key)
        name = f"{one.policy.name} on {one.device.name}" if policies > 1 else one.device.name
        blocks += _placement(one, executable, name)
    return Section("Placement", blocks)


def _placement(compiled: Compiled, executable: Executable, name: str) -> Iterator[Block]:
    device = compiled.device
    circuits: dict[int, list[int]] = {}
    count = len(executable.native) // compiled.copies
    for index, qubit in enumerate(executable.qubits.tolist()):
        circuits.setdefault(qubit, []).append(index % count)
    errors = [expected_error(device, qubit) for qubit in range(len(device.qubits))]
    left_out = unusable(device)
    shown = sorted(circuits) if len(errors) > _MOST_TILES else range(len(errors))
    tiles = [
        Tile(
            qubit,
            "unknown" if (error := errors[qubit]) is None else f"{error:.4f}",
            1.0 if error is None else min(max((error / PERFECT - 1) / _WARM, 0.0), 1.0),
            _placed(circuits.get(qubit, [])),
            left_out.get(qubit, ""),
        )
        for qubit in shown
    ]
    rounds = plural(executable.round_count, "round")
    side = f", {compiled.copies} copies side by side" if compiled.copies > 1 else ""
    yield Qubits(
        f"Qubits of {name}",
        tiles,
        f"{plural(count, 'circuit')}{side} in {rounds}; the circuits that matter most are on the "
        f"best qubits. The number beside a qubit is its error of <Z>: root mean square at "
        f"{REFERENCE_SHOTS} shots, readout mitigated; {PERFECT:.4f} if perfect.",
    )


def _placed(numbers: Sequence[int]) -> str:
    if not numbers:
        return ""
    distinct = sorted(set(numbers))
    word = "circuit" if len(distinct) == 1 else "circuits"
    return f"{word} {_numbers(distinct)}"
