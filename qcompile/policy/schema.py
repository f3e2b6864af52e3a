"""The schema of policy files, formats qcompile-policy-1 and qcompile-policy-2.

docs/reference/policies.md explains both. Format 2 allows more than this version can run:
unsupported parts are read and checked like the rest, and then refused by name
(qcompile/policy/refusals.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    JsonValue,
    Tag,
)

from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import Circuit, Program
from qcompile.limits import MAX_POLICY_GATES
from qcompile.policy.arguments import check_arguments
from qcompile.policy.blocks import (
    BlockFile,
    Natural,
    Number,
    Word,
    check_observables,
)
from qcompile.policy.decision import MOST_HELD
from qcompile.policy.encoder import Encoder, check_arrays
from qcompile.policy.policy import Policy
from qcompile.policy.refusals import other_decision, refuse
from qcompile.validation import FirstFault, Line

FORMAT_1: Literal["qcompile-policy-1"] = "qcompile-policy-1"
FORMAT_2: Literal["qcompile-policy-2"] = "qcompile-policy-2"

Numbers = Annotated[list[Number], FirstFault()]
CircuitFile = Annotated[list[Annotated[list[Word | Number], FirstFault()]], FirstFault()]
"""A list of gates, each a name and an angle."""

FUNCTIONS_1 = {"arctan", "tanh", "identity"}
"""The encoder functions of format 1."""

MOST_OBSERVABLES = 10_000


class Part(BaseModel):
    """A part of a policy file; unknown keys and wrong types are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


class EncoderFile(Part):
    """The encoder of format 1."""

    function: Literal["arctan", "tanh", "identity"]
    feature: Annotated[list[Natural], FirstFault()]
    scale: Numbers

    def encoder(self) -> Encoder:
        """The encoder that this describes."""
        return Encoder(
            self.function,
            np.array(self.feature, dtype=np.intp),
            np.array(self.scale, dtype=float),
        )


_Function = Literal["arctan", "tanh", "identity", "clip", "bits"]
_Functions = Annotated[
    Annotated[_Function, Tag("name")] | Annotated[list[_Function], FirstFault(), Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list) else "name"),
]


class EncoderFile2(Part):
    """The encoder of format 2; None has no effect."""

    function: _Functions
    feature: Annotated[list[Natural], FirstFault()]
    scale: Numbers
    gain: Numbers | None = None
    mean: Numbers | None = None
    std: Numbers | None = None

    def encoder(self) -> Encoder:
        """The encoder that this describes."""
        factors = (self.scale, self.gain, self.mean, self.std)
        return Encoder(
            self.function if isinstance(self.function, str) else tuple(self.function),
            np.array(self.feature, dtype=np.intp),
            *(None if numbers is None else np.array(numbers, dtype=float) for numbers in factors),  # type: ignore[arg-type]
        )


_Format = TypeVar("_Format", bound=str)
_Encoder = TypeVar("_Encoder", EncoderFile, EncoderFile2)
_Circuit = TypeVar("_Circuit")


def few_gates(circuits: list[Any]) -> list[Any]:
    """The `circuits`, checked to have at most MAX_POLICY_GATES gates."""
    if sum(map(len, circuits)) > MAX_POLICY_GATES:
        raise ValueError(f"more than {MAX_POLICY_GATES:,} gates")
    return circuits


class _File(Part, Generic[_Format, _Encoder, _Circuit]):
    """The parts that both formats have."""

    format: _Format
    name: Line
    environment: Line
    encoder: _Encoder
    circuits: Annotated[
        list[_Circuit], Field(min_length=1), FirstFault(), AfterValidator(few_gates)
    ]
    theta: Numbers
    weights: Annotated[list[Numbers], FirstFault()]
    bias: Annotated[Numbers, Field(min_length=1)]
    reuse: Annotated[int, Field(ge=1, le=10_000)] = 1
    metadata: dict[str, JsonValue] = {}

    def _program(self, circuits: Sequence[Circuit]) -> Program:
        return Program.of(circuits, len(self.encoder.feature), len(self.theta))

    def _policy(self, program: Program, **more: Any) -> Policy:
        return Policy(
            self.name,
            self.environment,
            self.encoder.encoder(),
            program,
            np.array(self.theta, dtype=float),
            self._weights(),
            np.array(self.bias, dtype=float),
            self.reuse,
            self.metadata,
            **more,
        )

    def _weights(self) -> Any:
        if len({len(row) for row in self.weights}) > 1:
            raise PolicyError("weights has rows of different lengths.")
        return np.array(self.weights, dtype=float)


def _circuit(index: int, gates: Sequence[Sequence[object]]) -> Circuit:
    try:
        return Circuit.of(gates)
    except CircuitError as error:
        raise PolicyError(f"circuits.{index}: {error}") from error


class PolicyFile(_File[Literal["qcompile-policy-1"], EncoderFile, CircuitFile]):
    """A policy file of format 1."""

    def policy(self) -> Policy:
        """The policy that this file describes.

        Raises:
            CircuitError, PolicyError: its parts do not fit each other.
        """
        circuits = [_circuit(index, gates) for index, gates in enumerate(self.circuits)]
        return self._policy(self._program(circuits))


_Circuit2 = Annotated[
    Annotated[CircuitFile, Tag("gates")] | Annotated[BlockFile, Tag("block")],
    Discriminator(lambda value: "block" if isinstance(value, dict | BlockFile) else "gates"),
]
_Observable = Annotated[list[Natural], Field(min_length=1, max_length=100), FirstFault()]


class PolicyFile2(_File[Literal["qcompile-policy-2"], EncoderFile2, _Circuit2]):
    """A policy file of format 2, which extends format 1."""

    observables: (
        Annotated[list[_Observable], Field(min_length=1, max_length=MOST_OBSERVABLES), FirstFault()]
        | None
    ) = None
    decision: Literal["softmax", "values", "gaussian", "born"] = "softmax"
    hold: Annotated[int, Field(ge=1, le=MOST_HELD)] = 1
    environment_kwargs: Annotated[dict[str, JsonValue], AfterValidator(check_arguments)] = {}

    def policy(self) -> Policy:
        """The policy that this file describes.

        Raises:
            CircuitError, PolicyError: its parts do not fit each other.
            UnsupportedPolicyError: they are valid, but this version cannot run them all.
        """
        self.encoder.encoder().check(len(self.encoder.feature))
        blocks = [part if isinstance(part, BlockFile) else None for part in self.circuits]
        widths = [1 if block is None else block.qubits for block in blocks]
        bits = sum(widths)
        if bits > MAX_POLICY_GATES:
            raise PolicyError(
                f"circuits have {bits:,} qubits.", f"At most {MAX_POLICY_GATES:,} are allowed."
            )
        observables = self.observables
        if observables is not None:
            check_observables(observables, widths)
        columns = self.reuse * (bits if observables is None else len(observables))
        check_arrays({"weights": (self._weights(), (len(self.bias), columns))})
        program = replace(
            self._program(self._circuits()), observables=tuple(map(tuple, observables or ()))
        )
        refuse(other_decision(self.decision))
        return self._policy(program, hold=self.hold, environment_kwargs=self.environment_kwargs)

    def _circuits(self) -> list[Circuit]:
        """The circuits of lists of gates and of blocks."""
        names = self._program([])
        symbols = {*names.inputs, *names.parameters}
        circuits = []
        for index, part in enumerate(self.circuits):
            if not isinstance(part, BlockFile):
                circuits.append(_circuit(index, part))
                continue
            try:
                part.check(symbols)
            except PolicyError as error:
                raise PolicyError(f"circuits.{index}.{error}") from error
            circuits.append(part.circuit())
        return circuits


AnyPolicyFile = Annotated[PolicyFile | PolicyFile2, Field(discriminator="format")]
"""A policy file of either format, as stored in a task."""


class AnyFormat(BaseModel):
    """The part of a file that determines its schema."""

    format: Literal["qcompile-policy-1", "qcompile-policy-2", "qcompile-network-1"]


SCHEMAS: dict[object, type[PolicyFile] | type[PolicyFile2]] = {
    FORMAT_1: PolicyFile,
    FORMAT_2: PolicyFile2,
}
