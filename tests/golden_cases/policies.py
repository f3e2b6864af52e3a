"""Policy files that are refused, and policies that no name or file leads to."""

from __future__ import annotations

import io
import os
import pickle
from pathlib import Path
from typing import Any

import torch

from .case import Command
from .inputs import ENCODER, policy, setting, write


class Code:
    """Pickled, this makes a folder when it is opened."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("ran",)


def encoder(**changes: Any) -> dict[str, Any]:
    return policy(encoder=ENCODER | changes)


def one_gate(*gate: Any) -> dict[str, Any]:
    """Four circuits of a gate."""
    return policy(circuits=[[list(gate)]] * 4)


def packed(value: Any, **options: Any) -> bytes:
    """What torch.save writes."""
    file = io.BytesIO()
    torch.save(value, file, **options)
    return file.getvalue()


def weighted(weights: Any) -> bytes:
    """A .pt file with these weights."""
    return packed(policy(weights=weights))


POLICIES: dict[str, Any] = {
    "no-format": policy(format=None),
    "no-theta-no-bias": policy(theta=None, bias=None),
    "format-9": policy(format="qcompile-policy-9"),
    "unknown-key": policy(extra=1),
    "name-empty": policy(name=""),
    "name-two-lines": policy(name="two\nlines"),
    "name-number": policy(name=3),
    "circuits-empty": policy(circuits=[]),
    "circuits-text": policy(circuits="h"),
    "circuits-of-texts": policy(circuits=["h"] * 4),
    "gate-empty": policy(circuits=[[[]]] * 4),
    "gate-unknown": one_gate("cx"),
    "gate-number": one_gate(3.0),
    "gate-two-angles": one_gate("ry", 1, 2),
    "gate-without-its-angle": one_gate("ry"),
    "gate-with-an-angle-too-many": one_gate("h", 1.0),
    "angle-product": one_gate("ry", "x0*x1"),
    "angle-words": one_gate("ry", "a b"),
    "angle-empty": one_gate("ry", ""),
    "angle-huge": one_gate("ry", 10**400),
    "angle-overflow": one_gate("ry", "1e308*10*x0"),
    "angle-true": one_gate("ry", True),
    "angle-long": one_gate("ry", "1+" * 6000 + "1"),
    "symbol-undeclared": one_gate("ry", "x9"),
    "theta-text": policy(theta=["one"]),
    "theta-null": policy(theta=[None]),
    "theta-missing": policy(theta=[]),
    "weights-uneven": policy(weights=[[1.0, 2.0], [3.0]]),
    "weights-narrow": policy(weights=[[1.0, 2.0], [3.0, 4.0]]),
    "weights-empty": policy(weights=[]),
    "bias-empty": policy(bias=[]),
    "bias-long": policy(bias=[0.0] * 3),
    "reuse-0": policy(reuse=0),
    "reuse-half": policy(reuse=1.5),
    "reuse-3": policy(reuse=3),
    "encoder-text": policy(encoder="arctan"),
    "encoder-sin": encoder(function="sin"),
    "encoder-feature-negative": encoder(feature=[-1, 0, 1, 2]),
    "encoder-scale-short": encoder(scale=[1.0]),
    "encoder-scale-huge": encoder(scale=[1.7e308] * 4),
    "encoder-offset": encoder(offset=[1]),
    "many-faults": policy(name=3, theta=["x"], weights="w", bias=[None], reuse=0),
}
TEXTS = {
    "empty.json": "",
    "list.json": "[1, 2]",
    "cut.json": '{"format": ',
    "twice.json": '{"name": 1, "name": 2}',
    "deep.json": "[" * 100_000,
    "digits.json": '{"theta": [' + "9" * 5000 + "]}",
    "nan.json": '{"theta": [NaN]}',
    "utf-16.json": "{}".encode("utf-16"),
    "latin.json": b'{"name":\n"\xe9"}',
}
FILES = {
    "code.pt": packed({"theta": Code()}),
    "pickle.pt": pickle.dumps(Code()),
    "cut.pt": packed({"theta": torch.zeros(100)})[:500],
    "text.pt": "theta = 3",
    "list.pt": packed([1, 2]),
    "tensor.pt": packed(torch.zeros(3)),
    "numbers.pt": packed({"a": 1}),
    "checkpoint.pt": packed({"format": "qcompile-checkpoint-1"}),
    "checkpoint-of-fcn.pt": packed(
        {
            "format": "qcompile-checkpoint-1",
            "environment": "CartPole-v1",
            "settings": '{"model": "fcn"}',
        }
    ),
    "checkpoint-of-a-shell.pt": packed(
        {"format": "qcompile-checkpoint-1", "environment": "x; rm -r x", "settings": torch.ones(2)}
    ),
    "weights-shape.pt": weighted(torch.zeros(2, 3)),
    "weights-flat.pt": weighted(torch.zeros(8)),
    "weights-scalar.pt": weighted(torch.tensor(1.0)),
    "weights-nan.pt": weighted(torch.full((2, 4), torch.nan)),
    "weights-complex.pt": weighted(torch.zeros(2, 4, dtype=torch.complex64)),
    "weights-sparse.pt": weighted(torch.eye(2).to_sparse()),
    "weights-expanded.pt": weighted(torch.zeros(1).expand(10**6, 10**6)),
}


def files() -> None:
    write({f"{name}.json": contents for name, contents in POLICIES.items()})
    write(TEXTS)
    write(FILES)
    Path("folder").mkdir()
    Path("folder.json").mkdir()
    os.mkfifo("pipe.json")
    write({"plain.json": policy()})


CASES = (
    *(f"show {name}.json" for name in POLICIES),
    *(f"show {name}" for name in (*TEXTS, *FILES)),
    "show folder.json",
    "show pipe.json",
    Command(
        "show plain.json",
        "with files of 100 bytes at most",
        setting("qcompile.reading.text.read_json.__defaults__", (100,)),
    ),
    Command(
        "show plain.json",
        "with 5 gates at most",
        setting("qcompile.policy.blocks.MAX_POLICY_GATES", 5),
    ),
    Command(
        "show plain.json",
        "with 9 values at most",
        setting("qcompile.reading.text.load_json.__defaults__", (9,)),
    ),
    Command("show plain.json", "with 5 keys at most", setting("qcompile.reading.text.MAX_KEYS", 5)),
    Command(
        "show weights-flat.pt",
        "with 5 numbers at most",
        setting("qcompile.policy.packed.MAX_VALUES", 5),
    ),
    "show nosuch",
    "show lunarlandr",
    "show LUNARLANDER2",
    "show ''",
    "show folder",
    "show no/such.pt",
    f"show {'x' * 500}",
    "show ñ💥",
)
