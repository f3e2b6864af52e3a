"""Files of circuits to train: JSON with numbered symbols and optional initial parameters.

A checkpoint contains the same text, so that a training of such circuits resumes from it alone.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError, PolicyError
from qcompile.foreign import describe, program_hint
from qcompile.ir import Program
from qcompile.output import write_file
from qcompile.policy.ansatz import NO_FACTOR, Ansatz
from qcompile.policy.blocks import (
    AnyCircuitFile,
    FewGates,
    Natural,
    ObservablesFile,
    check_observables,
    circuit_values,
    read_circuits,
    widths_of,
)
from qcompile.policy.encoder import Encoder
from qcompile.policy.files import SUFFIXES, load_circuits, policy_names
from qcompile.policy.policy import Policy
from qcompile.policy.schema import EncoderFile2, Numbers, Part
from qcompile.reading import ContentsError, check_json, read_json
from qcompile.validation import FirstFault, Line, explain

FORMAT: Literal["qcompile-ansatz-1"] = "qcompile-ansatz-1"

_Names = Annotated[list[Line], FirstFault()]


class AnsatzFile(Part):
    """Circuits to train; inputs and parameters default to those the circuits use."""

    format: Literal["qcompile-ansatz-1"]
    circuits: Annotated[list[AnyCircuitFile], Field(min_length=1), FirstFault(), FewGates]
    observables: ObservablesFile | None = None
    inputs: _Names | None = None
    parameters: _Names | None = None
    reads: Annotated[list[Natural], FirstFault()] | None = None
    factors: Annotated[list[Natural | None], FirstFault()] | None = None
    origin: Line = "a file of circuits"
    encoder: EncoderFile2 | None = None
    theta: Numbers | None = None
    weights: Annotated[list[Numbers], FirstFault()] | None = None
    bias: Numbers | None = None

    def ansatz(self) -> Ansatz:
        """The circuits that the file describes.

        Raises:
            CircuitError, PolicyError: the parts do not fit each other.
        """
        observables = self.observables or []
        check_observables(observables, widths_of(self.circuits))
        circuits = read_circuits(self.circuits)
        used = {symbol for circuit in circuits for symbol in circuit.symbols}
        inputs = self.inputs or _counted(used, "x")
        parameters = _counted(used, "theta") if self.parameters is None else self.parameters
        reads = [*range(len(inputs))] if self.reads is None else self.reads
        factors = [None] * len(reads) if self.factors is None else self.factors
        if self.weights and len({*map(len, self.weights)}) > 1:
            raise PolicyError("weights has rows of different lengths.")
        program = Program.of(circuits, len(reads), len(parameters))
        return Ansatz(
            replace(program, observables=tuple(map(tuple, observables))),
            tuple(inputs),
            tuple(parameters),
            np.array(reads, dtype=np.intp),
            np.array([NO_FACTOR if f is None else f for f in factors], dtype=np.intp),
            self.origin,
            None if self.encoder is None else self.encoder.encoder(),
            *(
                None if numbers is None else np.array(numbers, dtype=float)
                for numbers in (self.theta, self.weights, self.bias)
            ),
        )


def _counted(symbols: set[str], name: str) -> list[str]:
    """The names name0, name1, ... up to the last one among `symbols`."""
    numbers = [symbol.removeprefix(name) for symbol in symbols if symbol.startswith(name)]
    last = max((int(n) for n in numbers if n.isdecimal() and len(n) < 7), default=-1)
    return [f"{name}{i}" for i in range(last + 1)]


def ansatz_text(ansatz: Ansatz) -> str:
    """The JSON of a file, for `read_ansatz`."""
    values: dict[str, Any] = {
        "format": FORMAT,
        "origin": ansatz.origin,
        "circuits": [circuit_values(circuit) for circuit in ansatz.program.circuits],
        "inputs": ansatz.inputs,
        "parameters": ansatz.parameters,
        "reads": ansatz.reads.tolist(),
        "factors": [None if f == NO_FACTOR else f for f in ansatz.factors.tolist()],
    }
    if ansatz.program.observables:
        values["observables"] = ansatz.program.observables
    if ansatz.encoder is not None:
        values["encoder"] = _encoder_values(ansatz.encoder)
    for name in ("theta", "weights", "bias"):
        if (numbers := getattr(ansatz, name)) is not None:
            values[name] = numbers.tolist()
    return json.dumps(values)


def _encoder_values(encoder: Encoder) -> dict[str, Any]:
    arrays = {name: getattr(encoder, name) for name in ("feature", "scale", "gain", "mean", "std")}
    numbers = {name: array.tolist() for name, array in arrays.items() if array is not None}
    return {"function": encoder.function, **numbers}


def read_ansatz(text: str) -> Ansatz:
    """The circuits that a JSON text describes.

    Raises:
        ContentsError: it is not JSON.
        ValidationError: its values do not fit the schema.
        CircuitError, PolicyError: they do not fit each other.
    """
    return AnsatzFile.model_validate_json(check_json(text.encode())).ansatz()


def save_ansatz(ansatz: Ansatz, path: Path) -> None:
    """Write circuits to a JSON file; see `Ansatz.save`."""
    if path.suffix != ".json":
        raise PolicyError(
            f"{path} is not the name of a file of circuits.", "It must end with .json."
        )
    try:
        read_ansatz(text := ansatz_text(ansatz))
    except (ContentsError, ValidationError) as error:
        raise PolicyError("These circuits cannot be written to a file.", *explain(error)) from error
    write_file(path, text.encode())


def load_ansatz(source: Any) -> Ansatz:
    """The circuits of an Ansatz, a Program, a Policy, a Qiskit circuit, or a file.

    A file is a policy file (or the name of a shipped policy), a file from `Ansatz.save`, or
    OpenQASM.

    Raises:
        QcompileError: it cannot be read, or its circuits cannot be trained.
    """
    if isinstance(source, Ansatz):
        return source
    if isinstance(source, Policy):
        return Ansatz.of_policy(source)
    if isinstance(source, Program):
        return Ansatz.of_program(source)
    if isinstance(source, str | PathLike):
        return _loaded(Path(source))
    if describe(source) == "a Qiskit circuit":
        return Ansatz.from_qiskit(source)
    raise CircuitError(
        f"circuits cannot be {describe(source)}.",
        "Give an Ansatz, a Program, a Policy, a Qiskit circuit, or a file of one of these.",
        program_hint(source).replace("Program.from", "Ansatz.from"),
    )


def _loaded(path: Path) -> Ansatz:
    if path.suffix == ".json" and (ansatz := _from_json(path)):
        return ansatz
    if path.suffix == ".py":
        raise PolicyError(
            f"{path} is a Python file, not a file of circuits.",
            "Make it write them to a file: qcompile.Ansatz.from_qiskit(circuit).save('mine.json').",
        )
    known = [] if os.path.lexists(path) else policy_names()
    if path.suffix in SUFFIXES or fspath(path) in known:
        return Ansatz.of_policy(load_circuits(path))
    if known:
        raise PolicyError(
            f"There is no file or policy {path}.",
            nearest(fspath(path), known),
            "Give a policy, an OpenQASM file, or a file written by Ansatz.save.",
        )
    return replace(Ansatz.from_qasm(path), origin=f"OpenQASM {path.name}")


def _from_json(path: Path) -> Ansatz | None:
    """The circuits of a file in this format; None for any other."""
    try:
        text = read_json(path)
        values = json.loads(text)
        if not isinstance(values, dict) or values.get("format") != FORMAT:
            return None
        return AnsatzFile.model_validate_json(text).ansatz()
    except (OSError, ContentsError):
        return None
    except ValidationError as error:
        raise PolicyError(f"{path} is not a file of circuits.", *explain(error)) from error
    except (CircuitError, PolicyError) as error:
        lines = str(error).splitlines()
        raise PolicyError(f"{path} is not a file of circuits.", *lines) from error
