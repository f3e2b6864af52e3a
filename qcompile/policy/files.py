"""Policy files: JSON, and .pt with the same plain values and tensors for the numbers."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    JsonValue,
    ValidationError,
    field_validator,
)

from qcompile.catalogue import find, names, nearest
from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import Circuit, Program
from qcompile.limits import MAX_ANGLE_LETTERS, MAX_POLICY_GATES, MAX_VALUES
from qcompile.output import write_file
from qcompile.policy.policy import Encoder, Policy
from qcompile.reading import CodeError, ContentsError, read_file, read_json, read_torch
from qcompile.validation import Line, explain

if TYPE_CHECKING:
    from collections.abc import Mapping

SUFFIXES = (".pt", ".json")
_TENSORS = ("theta", "weights", "bias")

Number = Annotated[float, Field(allow_inf_nan=False)]
Natural = Annotated[int, Field(ge=0, le=1_000_000)]
Numbers = Annotated[list[Number], FailFast()]
Word = Annotated[str, Field(max_length=MAX_ANGLE_LETTERS)]
CircuitFile = Annotated[list[Annotated[list[Word | Number], FailFast()]], FailFast()]
"""Gates, each a name and its angle."""


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class EncoderFile(_Record):
    function: Literal["arctan", "tanh", "identity"]
    feature: Annotated[list[Natural], FailFast()]
    scale: Numbers


class PolicyFile(_Record):
    """The schema of a policy file, as docs/policies.md explains it."""

    format: Literal["qcompile-policy-1"]
    name: Line
    environment: Line
    encoder: EncoderFile
    circuits: Annotated[list[CircuitFile], Field(min_length=1), FailFast()]
    theta: Numbers
    weights: Annotated[list[Numbers], FailFast()]
    bias: Annotated[Numbers, Field(min_length=1)]
    reuse: Annotated[int, Field(ge=1, le=10_000)] = 1
    metadata: dict[str, JsonValue] = {}

    @field_validator("circuits")
    @classmethod
    def _few_gates(cls, circuits: list[CircuitFile]) -> list[CircuitFile]:
        if sum(map(len, circuits)) > MAX_POLICY_GATES:
            raise ValueError(f"more than {MAX_POLICY_GATES:,} gates")
        return circuits

    def policy(self) -> Policy:
        """The policy this file describes."""
        circuits = []
        for index, gates in enumerate(self.circuits):
            try:
                circuits.append(Circuit.of(gates))
            except CircuitError as error:
                raise PolicyError(f"circuits.{index}: {error}") from error
        if len({len(row) for row in self.weights}) > 1:
            raise PolicyError("weights has rows of different lengths.")
        inputs = len(self.encoder.feature)
        return Policy(
            self.name,
            self.environment,
            Encoder(
                self.encoder.function,
                np.array(self.encoder.feature, dtype=np.intp),
                np.array(self.encoder.scale, dtype=float),
            ),
            Program.of(circuits, inputs, len(self.theta)),
            np.array(self.theta, dtype=float),
            np.array(self.weights, dtype=float),
            np.array(self.bias, dtype=float),
            self.reuse,
            self.metadata,
        )


def policy_names() -> list[str]:
    """Every policy known by name."""
    return names("trained", SUFFIXES)


def load_policy(name: str | Path) -> Policy:
    """The policy of the file at this path, or shipped in trained/ under this bare name.

    Raises:
        PolicyError: there is no such file, or its contents are wrong; the message says what.
    """
    path = find("trained", str(name), SUFFIXES)
    if path is None:
        raise PolicyError(
            f"Unknown policy {str(name)!r}.",
            nearest(str(name), policy_names()),
            "A path to a .pt or .json policy file works too.",
        )
    try:
        if path.suffix == ".pt":
            return PolicyFile.model_validate(_read_pt(path)).policy()
        return PolicyFile.model_validate_json(read_json(path)).policy()
    except (OSError, ContentsError, ValidationError) as error:
        raise PolicyError(f"{path} is no policy file.", *explain(error)) from error
    except (CircuitError, PolicyError) as error:
        if isinstance(error, _UnreadableError):
            raise
        raise PolicyError(f"{path} is no policy file.", *str(error).splitlines()) from error


class _UnreadableError(PolicyError):
    """A file that could not even be opened as what it claims to be."""


def _read_pt(path: Path) -> dict[str, Any]:
    contents = read_file(path)
    try:
        values = read_torch(contents)
    except ContentsError as error:
        if contents[:1] != pickle.PROTO and not isinstance(error, CodeError):
            raise _UnreadableError(
                f"{path} cannot be read as a .pt file.",
                str(error),
                "Copy or train it again.",
            ) from error
        what = "holds more than tensors and plain values"
        if contents[:1] == pickle.PROTO:
            what = "cannot be read as a .pt file: it is a bare pickle"
        raise _UnreadableError(
            f"{path} {what}, and was not loaded.",
            "A pickle can carry code that runs when it is opened.",
            "Save the policy with qcompile, or as JSON.",
        ) from error
    if not isinstance(values, dict):
        raise _UnreadableError(
            f"{path} holds a {type(values).__name__}.", "A policy file is a dict."
        )
    if values.get("format") == "qcompile-checkpoint-1":
        raise _UnreadableError(
            f"{path} is the checkpoint of a training, found where a policy file is needed.",
            "A training of model svqc or surrogate makes one: "
            f"qcompile train ENVIRONMENT --resume {path} --out POLICY.pt",
        )
    tensors = {key: value for key, value in values.items() if hasattr(value, "tolist")}
    if sum(tensor.numel() for tensor in tensors.values()) > MAX_VALUES:
        raise _UnreadableError(f"{path} has tensors of more than {MAX_VALUES:,} numbers.")
    return values | {key: tensor.tolist() for key, tensor in tensors.items()}


def policy_values(policy: Policy) -> dict[str, Any]:
    """The plain values of a policy file; `PolicyFile` reads them back to an equal policy."""
    return {
        "format": "qcompile-policy-1",
        "name": policy.name,
        "environment": policy.environment,
        "encoder": {
            "function": policy.encoder.function,
            "feature": policy.encoder.feature.tolist(),
            "scale": policy.encoder.scale.tolist(),
        },
        "circuits": [circuit.to_lists() for circuit in policy.program.circuits],
        "theta": policy.theta.tolist(),
        "weights": policy.weights.tolist(),
        "bias": policy.bias.tolist(),
        "reuse": policy.reuse,
        "metadata": dict(policy.metadata),
    }


def save_policy(policy: Policy, path: str | Path) -> None:
    """Write `policy` to `path`, whole or not at all; the suffix, .pt or .json, says how.

    Raises:
        PolicyError: another suffix, or a policy that the file could not give back.
        OutputError: the file cannot be written.
    """
    path, values = Path(path), policy_values(policy)
    if path.suffix not in SUFFIXES:
        raise PolicyError(f"{path} is no policy file name.", "It ends with .pt or .json.")
    try:
        as_json = PolicyFile.model_validate_json(json.dumps(values))
        as_json.policy()
    except (TypeError, ValueError) as error:
        raise PolicyError(
            f"Policy {policy.name!r} cannot be written to a file.", *explain(error)
        ) from error
    if path.suffix == ".json":
        write_file(path, as_json.model_dump_json(indent=1).encode())
    else:
        write_file(path, _pt_bytes(as_json.model_dump()))


def _pt_bytes(values: Mapping[str, Any]) -> bytes:
    import io

    import torch

    tensors = {k: torch.tensor(values[k], dtype=torch.float64) for k in _TENSORS}
    buffer = io.BytesIO()
    torch.save({**values, **tensors}, buffer)
    return buffer.getvalue()
