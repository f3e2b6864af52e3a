"""Policy files: JSON, or .pt with the same values and tensors for the numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from qcompile.catalogue import find, names, nearest
from qcompile.errors import CircuitError, PolicyError
from qcompile.foreign import describe
from qcompile.output import write_file
from qcompile.policy.blocks import BlockFile, circuit_values
from qcompile.policy.decision import hold_values
from qcompile.policy.encoder import Encoder
from qcompile.policy.network import Network
from qcompile.policy.network_file import (
    NETWORK_1,
    ConvolutionFile,
    DenseFile,
    NetworkFile,
    network_values,
)
from qcompile.policy.packed import UnreadableError, pt_bytes, read_pt
from qcompile.policy.policy import Policy
from qcompile.policy.refusals import UnsupportedPolicyError
from qcompile.policy.schema import (
    FORMAT_1,
    FORMAT_2,
    FUNCTIONS_1,
    SCHEMAS,
    AnyFormat,
    EncoderFile,
    EncoderFile2,
    PolicyFile,
    PolicyFile2,
)
from qcompile.reading import ContentsError, check_json, read_json
from qcompile.validation import explain

_Schema = TypeVar("_Schema", bound=BaseModel)

SUFFIXES = (".pt", ".json")

AnyPolicy = Policy | Network
"""A policy of circuits, or a network."""


def policy_names() -> list[str]:
    """The names of all shipped policies."""
    return names("trained", SUFFIXES)


def policy_path(policy: object) -> Path | None:
    """The file that a policy is loaded from; None for an object, or if there is none."""
    if not isinstance(policy, str | PathLike):
        return None
    return find("trained", fspath(policy), SUFFIXES)


def load_policy(policy: str | PathLike[str] | AnyPolicy) -> AnyPolicy:
    """The policy in a file, or the shipped policy with a bare name.

    The result is a Policy of circuits or a Network; a loaded policy is returned unchanged.

    Raises:
        PolicyError: there is no such file, or its contents are not valid.
    """
    if isinstance(policy, Policy | Network):
        return policy
    if not isinstance(policy, str | PathLike):
        raise PolicyError(f"load_policy takes a name or a file, not {describe(policy)}.")
    path = policy_path(policy)
    if path is None:
        raise PolicyError(
            f"Unknown policy {fspath(policy)!r}.",
            nearest(fspath(policy), policy_names()),
            "You can also give the path of a .pt or .json policy file.",
        )
    try:
        return _validated(read_pt(path) if path.suffix == ".pt" else read_json(path)).policy()
    except (OSError, ContentsError) as error:
        raise PolicyError(f"{path} is not a policy file.", *explain(error)) from error
    except UnreadableError:
        raise
    except (CircuitError, PolicyError) as error:
        lines = str(error).splitlines()
        if isinstance(error, UnsupportedPolicyError):
            what = f"{path} is a policy that this version cannot run."
            raise UnsupportedPolicyError(what, *lines) from error
        raise PolicyError(f"{path} is not a policy file.", *lines) from error


def load_circuits(policy: str | PathLike[str] | AnyPolicy) -> Policy:
    """The policy from `load_policy`, which must be made of circuits.

    Raises:
        PolicyError: as for `load_policy`, or it is a network.
    """
    loaded = load_policy(policy)
    if isinstance(loaded, Policy):
        return loaded
    word = fspath(policy) if isinstance(policy, str | PathLike) else loaded.name
    raise PolicyError(
        f"{word} is a network, not circuits: there is nothing to compile or measure.",
        "`qcompile run` and `qcompile evaluate` play it, on `ideal`.",
    )


def _validated(source: str | dict[str, Any]) -> PolicyFile | PolicyFile2 | NetworkFile:
    """The policy file with this JSON text or these plain values.

    Raises:
        PolicyError: they do not form a policy file; for unknown keys the message suggests the
            nearest known ones.
    """
    try:
        format_ = _by_schema(AnyFormat, source).format
        return _by_schema(_SCHEMAS[format_], source)
    except ValidationError as error:
        lines = explain(error, words={"extra_forbidden": "unknown key"})
        values = json.loads(source) if isinstance(source, str) else source
        raise PolicyError("\n".join([*lines, *_hints(error, values)])) from error


def _by_schema(schema: type[_Schema], source: str | dict[str, Any]) -> _Schema:
    if isinstance(source, str):
        return schema.model_validate_json(source)
    return schema.model_validate(source)


def _hints(error: ValidationError, values: Any) -> list[str]:
    """Advice on unknown keys and on a wrong format."""
    format_ = values.get("format") if isinstance(values, dict) else None
    if str(format_).startswith("qcompile-ansatz"):
        return ["These are circuits to train: qcompile train ENVIRONMENT --circuits FILE."]
    is_first = format_ == FORMAT_1
    if is_first:
        try:
            PolicyFile2.model_validate(values | {"format": FORMAT_2})
        except ValidationError:
            pass
        else:
            return [f'It is valid in the other format: "format": "{FORMAT_2}".']
    parts = {FORMAT_1: _PARTS_1, NETWORK_1: _PARTS_OF_NETWORKS}.get(str(format_), _PARTS_2)
    lines = []
    for fault in error.errors(include_url=False, include_context=False)[:2]:
        *place, key = fault["loc"] or [""]
        if fault["type"] == "extra_forbidden":
            part = place[-1] if place else ""
            is_later = is_first and key in _PARTS_2[part].model_fields
            later = f'{key} belongs to format "{FORMAT_2}".'
            lines.append(later if is_later else nearest(str(key), parts[part].model_fields))
    return lines


_PARTS_1: dict[object, type[BaseModel]] = {"": PolicyFile, "encoder": EncoderFile}
_PARTS_2: dict[object, type[BaseModel]] = {
    "": PolicyFile2,
    "encoder": EncoderFile2,
    "block": BlockFile,
}
"""The schemas of a file, of its encoder and of a block."""
_PARTS_OF_NETWORKS: dict[object, type[BaseModel]] = {
    "": NetworkFile,
    "dense": DenseFile,
    "convolution": ConvolutionFile,
}
_SCHEMAS: dict[object, type[PolicyFile | PolicyFile2 | NetworkFile]] = {
    **SCHEMAS,
    NETWORK_1: NetworkFile,
}


def policy_values(policy: AnyPolicy) -> dict[str, Any]:
    """The plain values of a policy file, which its schema reads back as an equal policy.

    Policies of circuits use format 1, or format 2 if they need it. A file numbers its symbols:
    input i is x{i} and parameter i is theta{i}.
    """
    if isinstance(policy, Network):
        return network_values(policy)
    encoder, of_encoder = policy.encoder, _beyond_format_1(policy.encoder)
    name = encoder.function if isinstance(encoder.function, str) else "identity"
    program = policy.program
    symbols = {symbol: f"x{i}" for i, symbol in enumerate(program.inputs)}
    symbols |= {symbol: f"theta{i}" for i, symbol in enumerate(program.parameters)}
    more: dict[str, Any] = {**hold_values(policy.hold)}
    if policy.environment_kwargs:
        more["environment_kwargs"] = dict(policy.environment_kwargs)
    if program.observables:
        more["observables"] = [[*observable] for observable in program.observables]
    return {
        "format": FORMAT_2 if more or of_encoder or program.is_wide else FORMAT_1,
        "name": policy.name,
        "environment": policy.environment,
        "encoder": {
            "function": next(iter(encoder.functions), name),
            "feature": encoder.feature.tolist(),
            "scale": encoder.scale.tolist(),
            **of_encoder,
        },
        "circuits": [circuit_values(circuit.rename(symbols)) for circuit in program.circuits],
        "theta": policy.theta.tolist(),
        "weights": policy.weights.tolist(),
        "bias": policy.bias.tolist(),
        "reuse": policy.reuse,
        "metadata": dict(policy.metadata),
        **more,
    }


def _beyond_format_1(encoder: Encoder) -> dict[str, Any]:
    """The keys and values of an encoder that format 1 does not allow."""
    names = encoder.functions
    values: dict[str, Any] = {}
    if len(set(names)) > 1:
        values["function"] = [*names]
    elif not {*names} <= FUNCTIONS_1:
        values["function"] = names[0]
    neutral = {"gain": (encoder.gain, 1.0), "mean": (encoder.mean, 0.0), "std": (encoder.std, 1.0)}
    for key, (array, number) in neutral.items():
        if array is not None and (array != number).any():
            values[key] = array.tolist()
    return values


def trained_name(environment: str) -> str:
    """What a trained policy is called until it has a file, such as trained-cartpole."""
    return f"trained-{environment.rsplit('-v', 1)[0].lower()}"


def save_policy(policy: AnyPolicy, path: str | Path) -> None:
    """Write `policy` to `path`, whole or not at all; the suffix .pt or .json sets the format.

    A trained policy that was not named yet is named after the file.

    Raises:
        PolicyError: the suffix is different, or the policy cannot be stored in a file.
        OutputError: the file cannot be written.
    """
    if not isinstance(path, str | PathLike) or not isinstance(policy, Policy | Network):
        raise PolicyError(
            f"save_policy takes a Policy or a Network, and a path, not {describe(policy)} "
            f"and {describe(path)}."
        )
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise PolicyError(f"{path} is not a policy file name.", "It must end with .pt or .json.")
    if policy.name == trained_name(policy.environment):
        policy = replace(policy, name=path.stem)
    file = policy_file(policy)
    if path.suffix == ".json":
        write_file(path, file.model_dump_json(indent=1, exclude_unset=True).encode())
    else:
        write_file(path, pt_bytes(file.model_dump(exclude_unset=True)))


def policy_file(policy: AnyPolicy) -> PolicyFile | PolicyFile2 | NetworkFile:
    """The file that stores a policy.

    Raises:
        PolicyError: the policy cannot be stored in a file.
    """
    values = policy_values(policy)
    try:
        text = json.dumps(values)
        check_json(text.encode())
        file = _SCHEMAS[values["format"]].model_validate_json(text)
        file.policy()
    except (TypeError, ValueError) as error:
        raise PolicyError(
            f"Policy {policy.name!r} cannot be written to a file.", *explain(error)
        ) from error
    return file
