"""The .pt form of policy files: the values of the JSON, with tensors for the numbers."""

from __future__ import annotations

import io
import pickle
import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from qcompile.errors import PolicyError
from qcompile.limits import MAX_VALUES
from qcompile.reading import CodeError, ContentsError, read_file, read_torch

_TENSORS = ("theta", "weights", "bias", "mean", "std")
_CHECKPOINT_1 = "qcompile-checkpoint-1"
_ENVIRONMENT = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_./-]{0,99}")
"""An environment id that is safe to quote in a command."""


class UnreadableError(PolicyError):
    """The file is not in the format that its suffix claims."""


def read_pt(path: Path) -> dict[str, Any]:
    """The plain values of a .pt file, with lists in place of tensors.

    Raises:
        OSError: the file cannot be read.
        UnreadableError: it is not a dict of tensors and plain values, or is a checkpoint.
    """
    contents = read_file(path)
    try:
        values = read_torch(contents)
    except ContentsError as error:
        if contents[:1] != pickle.PROTO and not isinstance(error, CodeError):
            raise UnreadableError(
                f"{path} cannot be read as a .pt file.",
                str(error),
                "Copy it again, or train the policy again.",
            ) from error
        what = "contains more than tensors and plain values"
        if contents[:1] == pickle.PROTO:
            what = "cannot be read as a .pt file: it is a bare pickle"
        raise UnreadableError(
            f"{path} {what}, and was not loaded.",
            "A pickle can carry code that runs when it is opened.",
            "Save the policy with qcompile, or as JSON.",
        ) from error
    if not isinstance(values, dict):
        raise UnreadableError(
            f"{path} contains a {type(values).__name__}.", "A policy file must contain a dict."
        )
    if values.get("format") == _CHECKPOINT_1:
        raise UnreadableError(
            f"{path} is the checkpoint of a training, not a policy file.",
            *_resume_hint(path, values),
        )
    if sum(tensor.numel() for tensor in _tensors(values)) > MAX_VALUES:
        raise UnreadableError(f"{path} has tensors of more than {MAX_VALUES:,} numbers.")
    return {key: _plain(value) for key, value in values.items()}


def _resume_hint(path: Path, checkpoint: Mapping[str, Any]) -> list[str]:
    """How to turn a checkpoint into a policy; its values are not yet validated."""
    environment = checkpoint.get("environment")
    if not isinstance(environment, str) or not _ENVIRONMENT.fullmatch(environment):
        environment = "ENVIRONMENT"
    command = f"qcompile train {environment} --resume {shlex.quote(str(path))} --out POLICY.pt"
    return [f"This makes a policy of it: {command}", "A finished training is not trained further."]


def _tensors(value: Any) -> Iterator[Any]:
    """All tensors nested in a value."""
    if hasattr(value, "tolist"):
        yield value
    elif isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _tensors(part)


def _plain(value: Any) -> Any:
    """The value, with lists in place of tensors."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    return [_plain(part) for part in value] if isinstance(value, list) else value


def pt_bytes(values: Mapping[str, Any]) -> bytes:
    """The contents of a .pt file with the values of a policy file."""
    import torch

    buffer = io.BytesIO()
    torch.save(_packed(values), buffer)
    return buffer.getvalue()


def _packed(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values with tensors in place of numbers, also in layers."""
    import torch

    packed = dict(values)
    for key in _TENSORS:
        if isinstance(packed.get(key), list):
            packed[key] = torch.tensor(packed[key], dtype=torch.float64)
    if "layers" in packed:
        packed["layers"] = [_packed(layer) for layer in packed["layers"]]
    return packed
