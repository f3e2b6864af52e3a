"""The template: a Qiskit circuit of fused runs, with the instructions between them.

Source: qiskit.circuit, QuantumCircuit and ParameterVector.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from qcompile.arrays import IntArray
from qcompile.interop.late.instructions import Between, Instructions
from qcompile.ir import Gate, Program


def assembled(source: Any, instructions: Instructions, template: Program) -> tuple[Any, IntArray]:
    """The template as a QuantumCircuit, and the parameters that it takes unchanged.

    Its parameters are one vector: the open angles of runs, the open interactions, then those of
    other instructions, control flow included, as they are.
    """
    from qiskit.circuit import ParameterVector

    passed = list(dict.fromkeys(_passed(instructions)))
    counts = len(template.inputs), len(instructions.interactions), len(passed)
    vector = ParameterVector("late", sum(counts))
    angles = dict(zip(template.inputs, vector, strict=False))
    interactions = vector[counts[0] : counts[0] + counts[1]]
    unchanged = dict(zip(passed, vector[counts[0] + counts[1] :], strict=True))

    built = source.copy_empty_like()
    built.global_phase = 0.0
    between = iter(instructions.between)
    couplings = 0
    for gate in template.circuits[0].gates:
        if not gate.is_coupling:
            _append(built, gate, angles)
            continue
        couplings += 1
        if couplings == 1:
            current = next(between)
        if couplings == current.couplings:
            built.append(_reopened(source, current, interactions, unchanged))
            couplings = 0
    order = {parameter: index for index, parameter in enumerate(instructions.parameters)}
    return built, np.array([order[parameter] for parameter in passed], dtype=np.intp)


def _append(built: Any, gate: Gate, angles: Mapping[str, Any]) -> None:
    values = []
    if gate.angle is not None:
        constant = gate.angle.is_constant
        values = [gate.angle.constant if constant else angles[gate.angle.symbols[0]]]
    getattr(built, gate.name)(*values, gate.qubits[0])


def _reopened(
    source: Any, between: Between, interactions: Sequence[Any], unchanged: Mapping[Any, Any]
) -> Any:
    """The instruction with the parameters of the template."""
    instruction = between.instruction
    if between.interaction is not None:
        kind = type(instruction.operation)
        return instruction.replace(operation=kind(interactions[between.interaction]))
    if next(_parameters(instruction), None) is None:
        return instruction
    alone = source.copy_empty_like()
    alone.global_phase = 0.0
    alone.append(instruction)
    return alone.assign_parameters({p: unchanged[p] for p in alone.parameters}).data[0]


def _passed(instructions: Instructions) -> Iterator[Any]:
    for between in instructions.between:
        if between.interaction is None:
            yield from _parameters(between.instruction)


def _parameters(instruction: Any) -> Iterator[Any]:
    """The parameters of an instruction, those of its blocks included."""
    for value in instruction.operation.params:
        yield from getattr(value, "parameters", ())
