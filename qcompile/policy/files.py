"""Policy files: JSON, and .pt with the same plain values and tensors for the numbers."""

from __future__ import annotations

import json
import pickle
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ValidationError

from qcompile.catalogue import find, names, nearest
from qcompile.errors import CircuitError, PolicyError
from qcompile.foreign import what_it_is
from qcompile.limits import MAX_VALUES
from qcompile.output import write_file
from qcompile.policy.blocks import BlockFile
from qcompile.policy.encoder import Encoder
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
from qcompile.reading import CodeError, ContentsError, read_file, read_json, read_torch
from qcompile.validation import explain

if TYPE_CHECKING:
    from collections.abc import Mapping

_Schema = TypeVar("_Schema", bound=BaseModel)

SUFFIXES = (".pt", ".json")
_TENSORS = ("theta", "weights", "bias")


def policy_names() -> list[str]:
    """Every policy known by name."""
    return names("trained", SUFFIXES)


def load_policy(name: str | PathLike[str]) -> Policy:
    """The policy of the file at this path, or shipped in trained/ under this bare name.

    Raises:
        PolicyError: there is no such file, or its contents are wrong; the message says what.
    """
    if not isinstance(name, str | PathLike):
        raise PolicyError(f"load_policy takes a name or a file, found {what_it_is(name)}.")
    path = find("trained", fspath(name), SUFFIXES)
    if path is None:
        raise PolicyError(
            f"Unknown policy {fspath(name)!r}.",
            nearest(fspath(name), policy_names()),
            "A path to a .pt or .json policy file works too.",
        )
    try:
        return _validated(_read_pt(path) if path.suffix == ".pt" else read_json(path)).policy()
    except (OSError, ContentsError) as error:
        raise PolicyError(f"{path} is not a policy file.", *explain(error)) from error
    except _UnreadableError:
        raise
    except (CircuitError, PolicyError) as error:
        lines = str(error).splitlines()
        if isinstance(error, UnsupportedPolicyError):
            what = f"{path} is a policy that this version cannot run."
            raise UnsupportedPolicyError(what, *lines) from error
        raise PolicyError(f"{path} is not a policy file.", *lines) from error


def _validated(source: str | dict[str, Any]) -> PolicyFile | PolicyFile2:
    """The policy file with this JSON text, or with these plain values.

    Raises:
        PolicyError: they are not those of a policy file; keys that are not known are told the
            nearest that are.
    """
    try:
        format_ = _by_schema(AnyFormat, source).format
        return _by_schema(SCHEMAS[format_], source)
    except ValidationError as error:
        lines = explain(error, words={"extra_forbidden": "unknown key"})
        values = json.loads(source) if isinstance(source, str) else source
        raise PolicyError("\n".join([*lines, *_hints(error, values)])) from error


def _by_schema(schema: type[_Schema], source: str | dict[str, Any]) -> _Schema:
    if isinstance(source, str):
        return schema.model_validate_json(source)
    return schema.model_validate(source)


def _hints(error: ValidationError, values: Any) -> list[str]:
    """What to do about unknown keys, and about a file that says the wrong format."""
    is_first = isinstance(values, dict) and values.get("format") == FORMAT_1
    if is_first:
        try:
            PolicyFile2.model_validate(values | {"format": FORMAT_2})
        except ValidationError:
            pass
        else:
            return [f'It is right in the other format: "format": "{FORMAT_2}".']
    parts = _PARTS_1 if is_first else _PARTS_2
    lines = []
    for fault in error.errors(include_url=False, include_context=False)[:2]:
        *place, key = fault["loc"] or [""]
        if fault["type"] == "extra_forbidden":
            part = place[-1] if place else ""
            is_later = key in _PARTS_2[part].model_fields
            later = f'{key} is a key of format "{FORMAT_2}".'
            lines.append(later if is_later else nearest(str(key), parts[part].model_fields))
    return lines


_PARTS_1: dict[object, type[BaseModel]] = {"": PolicyFile, "encoder": EncoderFile}
_PARTS_2: dict[object, type[BaseModel]] = {
    "": PolicyFile2,
    "encoder": EncoderFile2,
    "block": BlockFile,
}
"""The schemas of a file, of its encoder and of a block."""


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
    """The plain values of a policy file; its schema reads them back to an equal policy.

    They are of format 1, unless the policy needs format 2; then of that with what it needs. A file
    counts its symbols: input i is called x{i} there and parameter i theta{i}.
    """
    encoder, of_encoder = policy.encoder, _beyond_format_1(policy.encoder)
    name = encoder.function if isinstance(encoder.function, str) else "identity"
    program = policy.program
    symbols = {symbol: f"x{i}" for i, symbol in enumerate(program.inputs)}
    symbols |= {symbol: f"theta{i}" for i, symbol in enumerate(program.parameters)}
    more: dict[str, Any] = {}
    if policy.environment_kwargs:
        more["environment_kwargs"] = dict(policy.environment_kwargs)
    return {
        "format": FORMAT_2 if more or of_encoder else FORMAT_1,
        "name": policy.name,
        "environment": policy.environment,
        "encoder": {
            "function": next(iter(encoder.functions), name),
            "feature": encoder.feature.tolist(),
            "scale": encoder.scale.tolist(),
            **of_encoder,
        },
        "circuits": [circuit.rename(symbols).to_lists() for circuit in program.circuits],
        "theta": policy.theta.tolist(),
        "weights": policy.weights.tolist(),
        "bias": policy.bias.tolist(),
        "reuse": policy.reuse,
        "metadata": dict(policy.metadata),
        **more,
    }


def _beyond_format_1(encoder: Encoder) -> dict[str, Any]:
    """The keys of an encoder that format 1 does not have, or not with this value."""
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


def save_policy(policy: Policy, path: str | Path) -> None:
    """Write `policy` to `path`, whole or not at all; the suffix, .pt or .json, says how.

    Raises:
        PolicyError: another suffix, or a policy that the file could not give back.
        OutputError: the file cannot be written.
    """
    if not isinstance(path, str | PathLike) or not isinstance(policy, Policy):
        raise PolicyError(
            f"save_policy takes a Policy and a path, found {what_it_is(policy)} "
            f"and {what_it_is(path)}."
        )
    path, values = Path(path), policy_values(policy)
    if path.suffix not in SUFFIXES:
        raise PolicyError(f"{path} is not a policy file name.", "It ends with .pt or .json.")
    try:
        as_json = SCHEMAS[values["format"]].model_validate_json(json.dumps(values))
        as_json.policy()
    except (TypeError, ValueError) as error:
        raise PolicyError(
            f"Policy {policy.name!r} cannot be written to a file.", *explain(error)
        ) from error
    if path.suffix == ".json":
        write_file(path, as_json.model_dump_json(indent=1, exclude_unset=True).encode())
    else:
        write_file(path, _pt_bytes(as_json.model_dump(exclude_unset=True)))


def _pt_bytes(values: Mapping[str, Any]) -> bytes:
    import io

    import torch

    tensors = {k: torch.tensor(values[k], dtype=torch.float64) for k in _TENSORS}
    buffer = io.BytesIO()
    torch.save({**values, **tensors}, buffer)
    return buffer.getvalue()
