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

from qcompile.errors import PolicyError
from qcompile.ir import Circuit, Program
from qcompile.policy.arguments import check_arguments
from qcompile.policy.blocks import (
    AnyCircuitFile,
    CircuitFile,
    FewGates,
    Natural,
    Number,
    ObservablesFile,
    check_observables,
    read_circuits,
    widths_of,
)
from qcompile.policy.decision import MOST_HELD
from qcompile.policy.encoder import Encoder, check_arrays
from qcompile.policy.policy import Policy
from qcompile.policy.refusals import other_decision, refuse
from qcompile.validation import FirstFault, Line

FORMAT_1: Literal["qcompile-policy-1"] = "qcompile-policy-1"
FORMAT_2: Literal["qcompile-policy-2"] = "qcompile-policy-2"

Numbers = Annotated[list[Number], FirstFault()]
FUNCTIONS_1 = {"arctan", "tanh", "identity"}
"""The encoder functions of format 1."""


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


class _File(Part, Generic[_Format, _Encoder, _Circuit]):
    """The parts that both formats have."""

    format: _Format
    name: Line
    environment: Line
    encoder: _Encoder
    circuits: Annotated[list[_Circuit], Field(min_length=1), FirstFault(), FewGates]
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


class PolicyFile(_File[Literal["qcompile-policy-1"], EncoderFile, CircuitFile]):
    """A policy file of format 1."""

    def policy(self) -> Policy:
        """The policy that this file describes.

        Raises:
            CircuitError, PolicyError: its parts do not fit each other.
        """
        return self._policy(self._program(read_circuits(self.circuits)))


class PolicyFile2(_File[Literal["qcompile-policy-2"], EncoderFile2, AnyCircuitFile]):
    """A policy file of format 2, which extends format 1."""

    observables: ObservablesFile | None = None
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
        widths, observables = widths_of(self.circuits), self.observables
        if observables is not None:
            check_observables(observables, widths)
        columns = self.reuse * (sum(widths) if observables is None else len(observables))
        check_arrays({"weights": (self._weights(), (len(self.bias), columns))})
        names = self._program([])
        circuits = read_circuits(self.circuits, {*names.inputs, *names.parameters})
        program = replace(self._program(circuits), observables=tuple(map(tuple, observables or ())))
        refuse(other_decision(self.decision))
        return self._policy(program, hold=self.hold, environment_kwargs=self.environment_kwargs)


AnyPolicyFile = Annotated[PolicyFile | PolicyFile2, Field(discriminator="format")]
"""A policy file of either format, as stored in a task."""


class AnyFormat(BaseModel):
    """The part of a file that determines its schema."""

    format: Literal["qcompile-policy-1", "qcompile-policy-2", "qcompile-network-1"]


SCHEMAS: dict[object, type[PolicyFile] | type[PolicyFile2]] = {
    FORMAT_1: PolicyFile,
    FORMAT_2: PolicyFile2,
}
