"""The circuits of a policy in a report: one of each shape, before and after compilation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.page.document import (
    Block,
    Heading,
    Picture,
    Prose,
    Section,
    Table,
)
from qcompile.passes import LEVELS, Executable, compile
from qcompile.policy import AnyPolicy, Network, Policy
from qcompile.report.circuit_words import gate_words, product_words
from qcompile.report.tables import plural
from qcompile.report.wires import angle_words

_MOST_LETTERS = 200_000
"""A longer drawing is of the first circuit alone."""


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
            # Circuits of several qubits are routed for a device, others only have its gates.
            routed_for = one.device.name if policy.program.is_wide else ""
            made = (one.device.native.gates, one.level, routed_for)
            if one.policy is policy and made not in seen:
                seen.add(made)
                alone = Compiled(policy, one.device, one.level).executable()
                blocks += [] if alone is None else _drawing(one, alone)
    return Section("Circuits", blocks)


def _drawing(compiled: Compiled, executable: Executable) -> Iterator[Block]:
    source, level = executable.source, compiled.level
    gates, count = " ".join(compiled.device.native.gates), plural(len(source), "circuit")
    if source.is_wide:
        count += f" on {plural(source.bits, 'qubit')}"
        gates += f" and {' or '.join(compiled.device.coupling_gates)}"
    yield Prose(f"{count}, compiled to {gates}. Level {level}: {LEVELS[level]}.")
    shown = None
    drawing = executable.draw("svg")
    if len(drawing) > _MOST_LETTERS and len(source) > 1:
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
        spoken="" if source.is_wide else executable.draw("text", shown),
    )
    if source.is_wide:
        yield _gates(compiled, executable)


def _gates(compiled: Compiled, executable: Executable) -> Table:
    """What each circuit has, before and after compilation, and what is measured of it."""
    source = executable.source
    rows = []
    for index, (before, first) in enumerate(zip(source.circuits, source.first_bits, strict=True)):
        after, bits = executable.native.circuits[index], range(first, first + before.width)
        measured = [bits_of for bits_of in source.measured if bits_of[0] in bits]
        rows.append(
            [
                str(index),
                str(before.width),
                ", ".join(map(product_words, measured)),
                gate_words(before.gate_counts),
                gate_words(after.gate_counts),
                f"{before.couplings} to {after.couplings}",
                f"{before.depth} to {after.depth}",
            ]
        )
    name = f"after, for {compiled.device.name}"
    columns = ["circuit", "qubits", "observables", "before", name, "couplings", "depth"]
    note = "depth: the most gates that follow each other, rz included."
    return Table(f"Gates, level {compiled.level}", columns, rows, note)
