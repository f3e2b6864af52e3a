"""Circuits to train: a program, the encoder of its inputs, and its initial parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import PolicyError
from qcompile.ir import Program
from qcompile.notebook import count
from qcompile.output import checked_path
from qcompile.policy.encoder import Encoder, check_arrays
from qcompile.policy.policy import Policy

if TYPE_CHECKING:
    from qcompile.interop.uploads import Uploads

NO_FACTOR = -1


@dataclass(frozen=True, eq=False, repr=False)
class Ansatz:
    """Circuits that `train` takes in place of a layout.

    `inputs` and `parameters` are the names of the circuits' inputs and trained parameters. The
    program has symbols x0, ... and theta0, ...: theta_j is parameter j, and x_i is input
    `reads[i]`, multiplied by parameter `factors[i]` unless that is -1. So an angle such as scale*x
    + shift, with two trained parameters, is affine in the program's symbols.

    Parts that are None are left to the training: `encoder` computes the inputs from an observation;
    `theta` (parameters,), `weights` (actions, observables) and `bias` (actions,) are initial
    values.
    `origin` says in a few words where the circuits come from.

    Raises:
        PolicyError: the parts do not fit each other, or the circuits read no input.
    """

    program: Program
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    reads: IntArray
    factors: IntArray
    origin: str
    encoder: Encoder | None = None
    theta: FloatArray | None = None
    weights: FloatArray | None = None
    bias: FloatArray | None = None

    def __post_init__(self) -> None:
        symbols = len(self.program.inputs), len(self.program.parameters)
        if self.program.late_angles:
            raise PolicyError("A compiled program cannot be trained.", "Use its source program.")
        if not len(self.program) or not symbols[0]:
            raise PolicyError(
                f"Circuits to train need an input: {count(len(self.program), 'circuit')} "
                f"read{'s' * (len(self.program) == 1)} {symbols[0]}.",
                "Inputs are symbols whose names start with x; in Python, inputs= can name others.",
            )
        check_arrays(
            {
                "reads": (self.reads, symbols[:1]),
                "factors": (self.factors, symbols[:1]),
                "theta": (self.theta, symbols[1:]),
            }
        )
        if len(self.parameters) != symbols[1]:
            raise PolicyError(f"{symbols[1]} parameters have {len(self.parameters)} names.")
        for name, numbers, least, size in (
            ("reads", self.reads, 0, len(self.inputs)),
            ("factors", self.factors, NO_FACTOR, symbols[1]),
        ):
            if not ((numbers >= least) & (numbers < size)).all():
                raise PolicyError(f"{name} contains a number outside {least} to {size - 1}.")
        if self.encoder is not None:
            self.encoder.check(len(self.inputs))
        if self.weights is not None and self.bias is not None:
            shape = (len(self.bias), len(self.program.measured))
            check_arrays({"weights": (self.weights, shape), "bias": (self.bias, (len(self.bias),))})

    @classmethod
    def of_program(cls, program: Program, origin: str = "a Program") -> Ansatz:
        """The circuits of a program, with its own inputs and parameters."""
        count = len(program.inputs)
        return cls._read(
            program,
            program.inputs,
            program.parameters,
            np.arange(count),
            np.full(count, NO_FACTOR),
            origin,
        )

    @classmethod
    def of_policy(cls, policy: Policy, *, head: bool = False) -> Ansatz:
        """The circuits, encoder and theta of a policy; with `head` also its weights and bias."""
        ansatz = replace(
            cls.of_program(policy.program, f"policy {policy.name}"),
            encoder=policy.encoder,
            theta=np.asarray(policy.theta, dtype=float),
        )
        if not head:
            return ansatz
        return replace(ansatz, weights=policy.folded().weights, bias=policy.bias)

    @classmethod
    def from_qiskit(cls, circuit: Any, inputs: str | Iterable[Any] | None = None) -> Ansatz:
        """The circuits of a Qiskit QuantumCircuit, read as by `Program.from_qiskit`.

        Its angles may contain products of an input and a parameter, such as s * x + t.

        Raises:
            CircuitError, MissingExtraError: as for that method.
        """
        from qcompile.interop.qiskit import uploads_of

        return cls._of_uploads(uploads_of(circuit, inputs), "a Qiskit circuit")

    @classmethod
    def from_pennylane(
        cls, function: Any, inputs: int | tuple[int, ...] = 0, parameters: int | tuple[int, ...] = 0
    ) -> Ansatz:
        """The circuits of a PennyLane function, read as by `Program.from_pennylane`.

        Its angles may contain products of an input and a parameter.

        Raises:
            CircuitError, MissingExtraError: as for that method.
        """
        from qcompile.interop.pennylane import uploads_of

        uploads = uploads_of(function, inputs, parameters)
        return cls._of_uploads(uploads, "a PennyLane circuit")

    @classmethod
    def from_qasm(
        cls, text_or_path: str | Path, inputs: str | Iterable[Any] | None = None
    ) -> Ansatz:
        """The circuits of OpenQASM 2 or 3, read as by `Program.from_qasm`.

        Its angles may contain products of an input and a parameter.

        Raises:
            CircuitError, ProgramFileError: as for that method.
        """
        from qcompile.interop.openqasm import uploads_of

        return cls._of_uploads(uploads_of(text_or_path, inputs), "OpenQASM")

    def policy(
        self,
        name: str,
        environment: str,
        encoder: Encoder,
        theta: FloatArray,
        weights: FloatArray,
        bias: FloatArray,
        *,
        reuse: int = 1,
        metadata: Mapping[str, Any] | None = None,
    ) -> Policy:
        """The policy of these circuits with trained parameters, from here or elsewhere.

        `encoder` computes `inputs`; `theta` has a value for each of `parameters`, in an array of
        any shape; `weights` and `bias` are as in Policy. Factors of inputs become gains of its
        encoder, and parameters that are only factors are dropped from theta.

        Raises:
            PolicyError: the shapes do not fit each other.
        """
        encoder.check(len(self.inputs))
        numbers = np.asarray(theta, dtype=float).ravel()
        check_arrays({"theta": (numbers, (len(self.parameters),))})
        used = {symbol for circuit in self.program.circuits for symbol in circuit.symbols}
        named = enumerate(self.program.parameters)
        indices = [j for j, symbol in named if symbol in used or j not in self.factors]
        names = {f"theta{j}": f"theta{index}" for index, j in enumerate(indices)}
        program = replace(
            self.program,
            circuits=tuple(circuit.rename(names) for circuit in self.program.circuits),
            parameters=tuple(f"theta{index}" for index in range(len(indices))),
        )
        return Policy(
            name,
            environment,
            self._encoder(encoder, np.append(numbers, 1.0)[self.factors]),
            program,
            numbers[indices],
            np.asarray(weights, dtype=float),
            np.asarray(bias, dtype=float),
            reuse,
            dict(metadata or {}),
        )

    def _encoder(self, encoder: Encoder, factor: FloatArray) -> Encoder:
        """The encoder of the program's inputs, from that of `inputs` and factors (inputs,)."""
        gain = None if encoder.gain is None else encoder.gain[self.reads]
        if (self.factors != NO_FACTOR).any():
            gain = factor if gain is None else gain * factor
        function = encoder.function
        if not isinstance(function, str):
            function = tuple(function[read] for read in self.reads)
        return replace(
            encoder,
            function=function,
            feature=encoder.feature[self.reads],
            scale=encoder.scale[self.reads],
            gain=gain,
        )

    def save(self, path: str | Path) -> None:
        """Write the circuits to a JSON file that `train --circuits` reads.

        Raises:
            PolicyError: the name does not end with .json.
            OutputError: the file cannot be written.
        """
        from qcompile.policy.ansatz_file import save_ansatz

        save_ansatz(self, checked_path(path))

    @property
    def has_own_names(self) -> bool:
        """Whether its parameters have names other than theta0, theta1, ..."""
        return self.parameters != self.program.parameters

    @property
    def without_numbers(self) -> Ansatz:
        """The same circuits and encoder, without initial parameters."""
        return replace(self, theta=None, weights=None, bias=None)

    @classmethod
    def _of_uploads(cls, uploads: Uploads, origin: str) -> Ansatz:
        count = len(uploads.inputs)
        products = np.array(uploads.products, dtype=np.intp).reshape(-1, 2)
        return cls._read(
            uploads.program,
            uploads.inputs,
            uploads.parameters,
            np.concatenate([np.arange(count), products[:, 0]]),
            np.concatenate([np.full(count, NO_FACTOR), products[:, 1]]),
            origin,
        )

    @classmethod
    def _read(
        cls,
        program: Program,
        inputs: tuple[str, ...],
        parameters: tuple[str, ...],
        reads: IntArray,
        factors: IntArray,
        origin: str,
    ) -> Ansatz:
        """The circuits with renamed symbols; inputs that no circuit uses are dropped."""
        if program.late_angles:
            raise PolicyError("A compiled program cannot be trained.", "Use its source program.")
        used = {symbol for circuit in program.circuits for symbol in circuit.symbols}
        order = np.lexsort((factors, reads)).tolist()  # an input, then its products
        used_inputs = [index for index in order if program.inputs[index] in used]
        names = {program.inputs[index]: f"x{i}" for i, index in enumerate(used_inputs)}
        names |= {name: f"theta{j}" for j, name in enumerate(program.parameters)}
        circuits = [circuit.rename(names) for circuit in program.circuits]
        renamed = Program.of(circuits, len(used_inputs), len(program.parameters))
        renamed = replace(renamed, observables=program.observables)
        return cls(renamed, inputs, parameters, reads[used_inputs], factors[used_inputs], origin)

    def __repr__(self) -> str:
        sizes = [count(len(self.program), "circuit"), count(len(self.inputs), "input")]
        sizes.append(count(len(self.parameters), "parameter"))
        return f"Ansatz({', '.join(sizes)}, of {self.origin})"

    def __str__(self) -> str:
        shown = dict(zip(self.program.parameters, self.parameters, strict=True))
        shown |= {f"x{i}": self._input_text(i) for i in range(len(self.reads))}
        lines = [f"inputs {' '.join(self.inputs)}", f"parameters {' '.join(self.parameters)}"]
        lines += [
            re.sub(r"[^\W\d]\w*", lambda word: shown.get(word[0], word[0]), line)
            for line in str(self.program).splitlines()[2:]
        ]
        return "\n".join(line.rstrip() for line in lines)

    def _input_text(self, index: int) -> str:
        read, factor = self.inputs[self.reads[index]], self.factors[index]
        return read if factor == NO_FACTOR else f"{self.parameters[factor]}*{read}"
