"""The text form of programs."""

from __future__ import annotations

import re

from qcompile.errors import CircuitError
from qcompile.ir.circuit import Circuit, LateAngle
from qcompile.ir.program import Program


def program_text(program: Program) -> str:
    """A line for inputs, parameters, each circuit, the observables and each late angle."""
    lines = [f"inputs {' '.join(program.inputs)}", f"parameters {' '.join(program.parameters)}"]
    for i, circuit in enumerate(program.circuits):
        width = f"[{circuit.width}]" if circuit.width > 1 else ""
        lines.append(f"{i}{width}: {circuit}")
    if program.observables:
        lines.append(f"observables {' '.join(','.join(map(str, o)) for o in program.observables)}")
    lines += [f"where {late}" for late in program.late_angles]
    return "\n".join(line.rstrip() for line in lines)


def parse_program(text: str) -> Program:
    """The program with this text form.

    Raises:
        CircuitError: a line cannot be read.
    """
    circuits: list[Circuit] = []
    symbols: dict[str, tuple[str, ...]] = {"inputs": (), "parameters": ()}
    late_angles, observables = [], ""
    for line in filter(None, map(str.strip, text.splitlines())):
        word, *rest = line.split()
        if word in symbols:
            symbols[word] = tuple(rest)
        elif match := re.fullmatch(r"observables((?: \d+(?:,\d+)*)+)", line):
            observables = match[1]
        elif match := re.fullmatch(r"where (\w+) = (first|polar|last)\{(.*)\}", line):
            late_angles.append(
                LateAngle(match[1], Circuit.parse(match[3]), match[2])  # type: ignore[arg-type]
            )
        elif match := re.fullmatch(r"(\d+)(?:\[(\d+)\])?:(.*)", line):
            if int(match[1]) != len(circuits):
                raise CircuitError(f"Expected circuit {len(circuits)}, found {line!r}.")
            circuits.append(Circuit.parse(match[3], int(match[2] or 1)))
        else:
            raise CircuitError(f"Cannot read the line {line!r} of a program.")
    return Program(
        tuple(circuits),
        symbols["inputs"],
        symbols["parameters"],
        tuple(late_angles),
        tuple(tuple(map(int, bits.split(","))) for bits in observables.split()),
    )
