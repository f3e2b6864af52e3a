"""Circuits drawn as wires, and the rows of `qcompile show`."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import click

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.ir import Circuit
from qcompile.noise import expected_error
from qcompile.passes import LEVELS, Executable
from qcompile.passes.place import circuit_importance
from qcompile.policy import Policy
from qcompile.policy.decision import hold_values
from qcompile.policy.encoder import BITS
from qcompile.report.drawing.text import gate_words
from qcompile.report.placement import left_out, print_placement
from qcompile.report.tables import plural, print_hold, print_table
from qcompile.report.wide import (
    observable_values,
    print_circuits,
    print_drawing,
    print_observables,
    wide_values,
)


def wire(circuit: Circuit) -> str:
    """A circuit as one line: |0>─ h ─ ry(x0) ─ M."""
    return "|0>─" + "─".join([*(f" {gate_words(gate)} " for gate in circuit.gates), " M"])


def angle_words(executable: Executable) -> list[str]:
    """What the names before {...} mean in definitions of angles; nothing where there are none."""
    parts = {late.part for late in executable.native.late_angles}
    if not parts:
        return []
    if parts == {"polar"}:
        return [
            "polar{gates}: the angle between |0> and the state that the gates make of it, from 0 "
            "to pi; its cosine is <Z>."
        ]
    return [
        "first{gates}, polar{gates}, last{gates}: the gates do what rz(first) ry(polar) rz(last) "
        "do."
    ]


def executable_values(
    executable: Executable,
    importance: FloatArray | None = None,
    numbers: Sequence[int] | None = None,
    *,
    policy: Policy | None = None,
    calibration: Calibration | None = None,
) -> dict[str, Any]:
    """The plain values of `qcompile show --json`, those of `policy` among them, where there is one.

    `importance` (observables,) is what the placement followed; left out, it is the same for all.
    `numbers` are what the circuits are called, instead of 0, 1, ... On the twin of a `calibration`
    qubits are left out that it does not hold.
    """
    native, device = executable.native, executable.device
    of_circuits = circuit_importance(executable.source, importance)
    shares = of_circuits / (of_circuits.sum() or 1.0)
    circuits = []
    inputs = {name: index for index, name in enumerate(executable.source.inputs)}
    rows = zip(executable.source.circuits, native.circuits, executable.gate_counts(), strict=True)
    for index, (source, compiled, counts) in enumerate(rows):
        is_wide = source.width > 1
        qubit = None if is_wide else int(executable.qubits[native.first_bits[index]])
        circuits.append(
            {
                "circuit": index if numbers is None else numbers[index],
                "source": str(source),
                **({} if policy is None else {"reads": _reads(source, policy, inputs)}),
                "compiled": str(compiled),
                "gates_before": len(source),
                "gates": dict(sorted(counts.items())),
                "depth": compiled.depth,
                "qubit": qubit,
                "round": int(executable.rounds[index]),
                "importance": float(shares[index]),
                "expected_error": (
                    None if device.is_ideal or qubit is None else expected_error(device, qubit)
                ),
                **(wide_values(executable, index) if executable.source.is_wide else {}),
            }
        )
    values = {
        "backend": device.name,
        "level": executable.level,
        "inputs": len(executable.source.inputs),
        "parameters": len(executable.source.parameters),
        "rounds": executable.round_count,
        "copies_that_fit": executable.copies_that_fit,
        "left_out": [
            {"qubit": qubit, "reason": reason}
            for qubit, reason in left_out(device, calibration).items()
        ],
        "circuits": circuits,
        "definitions": [str(late) for late in native.late_angles],
    }
    if executable.source.has_products:
        values["observables"] = observable_values(executable, importance)
    if policy is not None:
        values["policy"] = {
            "name": policy.name,
            "environment": policy.environment,
            "actions": policy.actions,
            "parameters": policy.parameter_count,
            **hold_values(policy.hold),
        }
    return values


def print_executable(executable: Executable, values: dict[str, Any]) -> None:
    """Print the circuits before and after compilation, and their placement on a device's qubits.

    `values` are those of `executable_values`.
    """
    source, level = executable.source, executable.level
    if policy := values.get("policy"):
        qubits = f" on {plural(source.bits, 'qubit')}" if source.is_wide else ""
        click.echo(
            f"{policy['name']} for {policy['environment']}: {plural(len(source), 'circuit')}"
            f"{qubits}, {policy['actions']} actions, {policy['parameters']} trained numbers"
        )
        print_hold(policy.get("hold", 1))
    click.echo(f"level {level}: {LEVELS[level]}")
    reads = [_reading_words(row["reads"]) for row in values["circuits"]] if policy else []
    if source.is_wide:
        click.echo()
        print_drawing(executable, [row["circuit"] for row in values["circuits"]])
        print_circuits(values, reads)
    else:
        _print_narrow(executable, values, reads)
    if policy:
        click.echo(_legend(values["circuits"]))
    if "observables" in values:
        print_observables(values)
    if values["definitions"]:
        if not source.is_wide:  # a drawing has them
            click.echo("Angles computed when an observation is bound, such as")
            click.echo(f"  {values['definitions'][0]}")
        for line in angle_words(executable):
            click.echo(textwrap.fill(line, 80, subsequent_indent="  "))
    if not executable.device.is_ideal:
        print_placement(values)


def _print_narrow(executable: Executable, values: dict[str, Any], reads: Sequence[str]) -> None:
    """Print circuits of one qubit, each as one line."""
    if len(executable.source):
        click.echo(f"  before  {wire(executable.source.circuits[0])}")
        click.echo(f"  after   {wire(executable.native.circuits[0])}")
    print_table(
        ["circuit", *["reads"] * bool(reads), "before", f"after, for {values['backend']}"],
        [
            [row["circuit"], *reads[index : index + 1], row["source"], row["compiled"]]
            for index, row in enumerate(values["circuits"])
        ],
        tight=True,
    )


def _reads(circuit: Circuit, policy: Policy, numbers: Mapping[str, int]) -> list[dict[str, Any]]:
    """What each input of a circuit reads of an observation; `numbers` are those of the inputs."""
    names = sorted({*circuit.symbols} & numbers.keys(), key=numbers.__getitem__)
    return [{"input": name, **policy.encoder.reading(numbers[name])} for name in names]


def _reading_words(reads: Sequence[dict[str, Any]]) -> str:
    """Scale and feature of each input, such as 2.5*obs[3]; named where there are several."""
    named = len(reads) > 1
    return "\n".join(f"{read['input']}: " * named + _reading(read) for read in reads)


def _reading(read: dict[str, Any]) -> str:
    if read["function"] == BITS:
        words = f"bit {read['feature']}"
    else:
        words = f"obs[{read['feature']}]"
        if "mean" in read:
            words = f"({words}{-read['mean']:+.3g})"
        if "std" in read:
            words += f"/{read['std']:.3g}"
        if read["scale"] != 1:
            words = f"{read['scale']:.3g}*{words}"
    return words if read.get("gain", 1) == 1 else f"{words}, gain {read['gain']:.3g}"


def _legend(circuits: Sequence[dict[str, Any]]) -> str:
    """What the column `reads` means."""
    reads = [read for row in circuits for read in row["reads"]]
    functions = " or ".join(dict.fromkeys(read["function"] for read in reads))
    if functions == BITS:
        words = "a bit of the observation, a number; x is pi times the bit"
    else:
        words = f"a feature of the observation (obs) times its scale; x is its {functions}"
    return f"reads: {words}" + ", times the gain" * any("gain" in read for read in reads)
