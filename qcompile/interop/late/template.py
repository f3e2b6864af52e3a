"""The template: a Qiskit circuit of fused runs, with the instructions between them.

Source: qiskit.circuit, QuantumCircuit and ParameterVector.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from qcompile.arrays import IntArray
from qcompile.interop.late.instructions import Between, Instructions
from qcompile.interop.late.operations import with_angle
from qcompile.ir import Gate, Program


def assembled(source: Any, instructions: Instructions, template: Program) -> tuple[Any, IntArray]:
    """The template as a QuantumCircuit, and the parameters that it takes unchanged.

    Its parameters are one vector: the open angles of runs, the open interactions, then those of
    other instructions, control flow included, as they are. The vector is `late`, with more
    underscores where the source has such names.
    """
    from qiskit.circuit import ParameterVector

    between = [_alone(source, each) for each in instructions.between]
    passed = list(dict.fromkeys(p for each in between if each for p in each.parameters))
    counts = len(template.inputs), len(instructions.interactions), len(passed)
    vector = ParameterVector(_free_name(source), sum(counts))
    angles = dict(zip(template.inputs, vector, strict=False))
    interactions = vector[counts[0] : counts[0] + counts[1]]
    unchanged = dict(zip(passed, vector[counts[0] + counts[1] :], strict=True))

    built = source.copy_empty_like()
    built.global_phase = 0.0
    built._op_start_times = None  # those of a scheduled circuit, which fusing changes
    pairs = zip(instructions.between, between, strict=True)
    couplings = 0
    for gate in template.circuits[0].gates:
        if not gate.is_coupling:
            _append(built, gate, angles)
            continue
        couplings += 1
        if couplings == 1:
            current, alone = next(pairs)
        if couplings == current.couplings:
            built.append(_reopened(current, alone, interactions, unchanged))
            couplings = 0
    order = {parameter: index for index, parameter in enumerate(instructions.parameters)}
    return built, np.array([order[parameter] for parameter in passed], dtype=np.intp)


def _alone(source: Any, between: Between) -> Any:
    """A circuit of the instruction alone, if it has parameters that stay as they are."""
    instruction = between.instruction
    is_open = any(getattr(value, "parameters", ()) for value in instruction.operation.params)
    if between.interaction is not None or not is_open:
        return None
    alone = source.copy_empty_like()
    alone.global_phase = 0.0
    alone.append(_with_own_blocks(instruction))
    return alone


def _with_own_blocks(instruction: Any) -> Any:
    """The instruction with copies of its blocks: Qiskit binds gates in blocks in place."""
    blocks = getattr(instruction.operation, "blocks", ())
    if not blocks:
        return instruction
    copies = []
    for block in blocks:
        copies.append(block.copy_empty_like())
        for inner in block.data:
            copies[-1].append(_with_own_blocks(inner))
    return instruction.replace(operation=instruction.operation.replace_blocks(copies))


def _free_name(source: Any) -> str:
    name, taken = "late", tuple(_names(source))
    while any(other.startswith(f"{name}[") for other in taken):
        name += "_"
    return name


def _names(circuit: Any) -> Iterator[str]:
    """The names of parameters, those of loops included."""
    yield from (parameter.name for parameter in circuit.parameters)
    for instruction in circuit.data:
        for block in getattr(instruction.operation, "blocks", ()):
            yield from _names(block)


def _append(built: Any, gate: Gate, angles: Mapping[str, Any]) -> None:
    values = []
    if gate.angle is not None:
        constant = gate.angle.is_constant
        values = [gate.angle.constant if constant else angles[gate.angle.symbols[0]]]
    getattr(built, gate.name)(*values, gate.qubits[0])


def _reopened(
    between: Between, alone: Any, interactions: Sequence[Any], unchanged: Mapping[Any, Any]
) -> Any:
    """The instruction with the parameters of the template."""
    if between.interaction is not None:
        return with_angle(between.instruction, interactions[between.interaction])
    if alone is None:
        return between.instruction
    return alone.assign_parameters({p: unchanged[p] for p in alone.parameters}).data[0]
