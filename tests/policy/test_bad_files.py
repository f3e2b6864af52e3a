"""Invalid policy files: refused with an explanation, and none of their code is run."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.errors import PolicyError
from qcompile.policy import load_policy, policy_names, save_policy

Make = Callable[..., Any]

SUFFIXES = (".json", ".pt")


class Touch:
    """Pickled, this is code that makes a folder when it is opened."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("where", ["alone", "in a dict"])
def test_code_in_a_pickle_is_not_run(
    tmp_path: Path, where: str, values: Make, write_pt: Make
) -> None:
    marker = tmp_path / "marker"
    code = Touch(marker)
    path = write_pt(tmp_path / "p.pt", code if where == "alone" else values() | {"metadata": code})
    with pytest.raises(PolicyError, match="contains more than tensors and plain values") as caught:
        load_policy(path)
    assert "can carry code" in str(caught.value)
    assert "weights_only" not in str(caught.value)
    assert not marker.exists()
    torch.load(path, weights_only=False)
    assert marker.exists(), "the pickle carries no code: the test shows nothing"


def test_a_damaged_pt_file_is_refused(tmp_path: Path, awkward: Make) -> None:
    path = tmp_path / "p.pt"
    save_policy(awkward(), path)
    whole = path.read_bytes()
    for size in (0, 1, 4, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(
            PolicyError, match=r"be read as a \.pt file\.\n  It is not a complete file"
        ):
            load_policy(path)


def test_random_bytes_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for suffix in SUFFIXES:
        path = tmp_path / f"p{suffix}"
        for length in range(1, 200, 3):
            path.write_bytes(rng.bytes(length))
            with pytest.raises(
                PolicyError, match=rf"p\{suffix} (cannot be read|contains more|is not a policy)"
            ):
                load_policy(path)


def test_random_opcodes_are_refused(tmp_path: Path) -> None:
    """Bytes that begin and end as a pickle: torch's reader fails with errors of many types."""
    rng, path = np.random.default_rng(1), tmp_path / "p.pt"
    for _ in range(200):
        path.write_bytes(b"\x80\x02" + rng.bytes(int(rng.integers(1, 30))) + b".")
        with pytest.raises(PolicyError, match=r"p\.pt"):
            load_policy(path)


def test_a_pt_file_of_something_else_is_refused(
    tmp_path: Path, values: Make, write_pt: Make
) -> None:
    with pytest.raises(PolicyError, match="contains a list"):
        load_policy(write_pt(tmp_path / "list.pt", [values()]))
    with pytest.raises(PolicyError, match="contains a Tensor"):
        load_policy(write_pt(tmp_path / "tensor.pt", torch.zeros(3)))


@pytest.mark.parametrize(
    ("tensor", "message"),
    [
        (torch.zeros(2, 3), r"weights has shape \(2, 3\)"),
        (torch.zeros(8), "weights.0"),
        (torch.zeros(2, 4, 1), "weights.0.0"),
        (torch.tensor(1.0), "weights: input should be a valid list"),
        (torch.zeros(2, 4, dtype=torch.complex64), "weights.0.0"),
        (torch.full((2, 4), torch.nan), "weights.0.0: input should be a finite number"),
        (torch.eye(2).to_sparse(), "cannot be read as a .pt file"),
        (torch.zeros(2, 4, device="meta"), "cannot be read as a .pt file"),
    ],
)
def test_tensors_that_do_not_fit_are_refused(
    tmp_path: Path, tensor: torch.Tensor, message: str, values: Make, write_pt: Make
) -> None:
    with pytest.raises(PolicyError, match=message):
        load_policy(write_pt(tmp_path / "p.pt", values() | {"weights": tensor}))


ENCODER = {"function": "tanh", "feature": [3, 0], "scale": [1, 0.5]}

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"format": "qcompile-policy-9"}, "format: input should be 'qcompile-policy-1'"),
    ({"theta": []}, "Unknown symbol 'theta0'"),
    ({"theta": [None]}, "theta.0"),
    ({"theta": ["one"]}, "theta.0"),
    ({"weights": [[1, 2, 3, 4], [5, 6, 7]]}, "weights has rows of different lengths"),
    ({"weights": [[1, 2], [3, 4]]}, r"weights has shape \(2, 2\)"),
    ({"weights": []}, "weights has shape"),
    ({"bias": []}, "bias: list should have at least 1 item"),
    ({"bias": [1, 2, 3]}, "weights has shape"),
    ({"reuse": 0}, "reuse: input should be greater than or equal to 1"),
    ({"reuse": 1.5}, "reuse"),
    ({"reuse": 3}, "weights has shape"),
    ({"circuits": []}, "circuits: list should have at least 1 item"),
    ({"circuits": [[["cx"]], [["h"]]]}, "circuits.0: Gate 'cx' acts on two qubits"),
    ({"circuits": [[["h"]], [["ry"]]]}, "circuits.1"),
    ({"circuits": [[["h", 1.0]], [["h"]]]}, "circuits.0"),
    ({"circuits": [[["ry", "x0*x1"]], [["h"]]]}, "circuits.0: 'x0\\*x1' is not an affine angle"),
    ({"circuits": [[["ry", "x5"]], [["h"]]]}, "Unknown symbol 'x5'"),
    ({"circuits": [[["ry", 1, 2]], [["h"]]]}, "circuits.0"),
    ({"circuits": [[[]], [["h"]]]}, "circuits.0"),
    ({"circuits": [["h"], [["h"]]]}, "circuits.0.0"),
    ({"encoder": ENCODER | {"function": "sin"}}, "encoder.function"),
    ({"encoder": ENCODER | {"feature": [-1, 0]}}, "encoder.feature.0"),
    ({"encoder": ENCODER | {"feature": [0.5, 0]}}, "encoder.feature.0"),
    ({"encoder": ENCODER | {"scale": [1]}}, r"encoder.scale has shape \(1,\)"),
    ({"encoder": ENCODER | {"offset": [1]}}, "encoder.offset: unknown key"),
    ({"encoder": None}, "encoder"),
    ({"extra": 1}, "extra: unknown key .found 1.\n  Known: format, name"),
    ({"byas": [0, 0]}, "byas: unknown key .*\n  Did you mean bias?"),
    ({"encoder": ENCODER | {"scales": [1, 1]}}, "\n  Did you mean scale?"),
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("change", "message"), WRONG)
def test_wrong_values_are_named(
    tmp_path: Path,
    suffix: str,
    change: dict[str, Any],
    message: str,
    values: Make,
    write_json: Make,
    write_pt: Make,
) -> None:
    write = write_json if suffix == ".json" else write_pt
    path = write(tmp_path / f"wrong{suffix}", values() | change)
    with pytest.raises(PolicyError, match=message) as caught:
        load_policy(path)
    assert str(caught.value).startswith(f"{path} is not a policy file.")


KEYS = ("format", "name", "environment", "encoder", "circuits", "theta", "weights", "bias")


@pytest.mark.parametrize("key", KEYS)
def test_a_missing_key_is_named(tmp_path: Path, key: str, values: Make, write_json: Make) -> None:
    document = values()
    del document[key]
    with pytest.raises(PolicyError, match=f"{key}: field required"):
        load_policy(write_json(tmp_path / "p.json", document))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
@pytest.mark.parametrize("key", ["theta", "bias", "weights", "scale", "angle"])
def test_a_number_that_is_not_finite_is_refused(
    tmp_path: Path, key: str, number: str, values: Make
) -> None:
    marks: dict[str, dict[str, Any]] = {
        "theta": {"theta": [77]},
        "bias": {"bias": [77, 0]},
        "weights": {"weights": [[77, 0, 0, 0], [0, 0, 0, 0]]},
        "scale": {"encoder": ENCODER | {"scale": [77, 1]}},
        "angle": {"circuits": [[["ry", 77]], [["h"]]]},
    }
    text = json.dumps(values() | marks[key])
    assert text.count("77") == 1
    path = tmp_path / "p.json"
    path.write_text(text.replace("77", number))
    with pytest.raises(PolicyError, match="is not a policy file"):
        load_policy(path)


@pytest.mark.parametrize("text", ["", "[]", "3", "null", "{", '{"format": 1', "\ufeff{}"])
def test_text_that_is_no_policy_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "p.json"
    path.write_text(text)
    with pytest.raises(PolicyError, match="is not a policy file"):
        load_policy(path)


def test_deep_nesting_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    path.write_text("[" * 100_000)
    with pytest.raises(PolicyError, match="is not a policy file"):
        load_policy(path)


def test_an_unknown_name_gets_the_nearest_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, awkward: Make
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "trained").mkdir()
    save_policy(awkward(), tmp_path / "trained" / "hovercraft.json")
    assert "hovercraft" in policy_names()
    assert load_policy("hovercraft").name == "awkward"
    with pytest.raises(PolicyError, match="Unknown policy 'hovercaft'") as caught:
        load_policy("hovercaft")
    assert "Did you mean hovercraft" in str(caught.value)
    with pytest.raises(PolicyError, match="Unknown policy"):
        load_policy(tmp_path)


STRICT: list[tuple[dict[str, Any], str]] = [
    ({"circuits": [[["ry", True]], [["h"]]]}, "circuits.0.0.1"),
    ({"theta": ["0.1"]}, "theta.0"),
    ({"theta": [True]}, "theta.0"),
    ({"bias": ["0.1", 0.0]}, "bias.0"),
    ({"weights": [[True, 0, 0, 0], [0, 0, 0, 0]]}, "weights.0.0"),
    ({"reuse": True}, "reuse"),
    ({"reuse": "2"}, "reuse"),
    ({"encoder": ENCODER | {"scale": ["1", 1]}}, "encoder.scale.0"),
    ({"encoder": ENCODER | {"feature": [True, 0]}}, "encoder.feature.0"),
    ({"name": "two\nlines"}, "name: must be one line of text"),
    ({"name": "\x1b[2J"}, "name: must be one line of text"),
    ({"name": ""}, "name: must be one line of text"),
    ({"name": "a\uffffb"}, "name: must be one line of text"),
    ({"name": "a\ufdd0b"}, "name: must be one line of text"),
    ({"environment": "CartPole-v1\x07"}, "environment: must be one line of text"),
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("change", "message"), STRICT)
def test_values_are_what_they_look_like(
    tmp_path: Path,
    suffix: str,
    change: dict[str, Any],
    message: str,
    values: Make,
    write_json: Make,
    write_pt: Make,
) -> None:
    test_wrong_values_are_named(tmp_path, suffix, change, message, values, write_json, write_pt)


@pytest.mark.parametrize(
    ("name", "kind"), [("p.json", "pipe"), ("p.pt", "pipe"), ("f.pt", "folder")]
)
def test_what_is_no_regular_file_is_named(tmp_path: Path, name: str, kind: str) -> None:
    path = tmp_path / name
    path.mkdir() if kind == "folder" else os.mkfifo(path)
    with pytest.raises(
        PolicyError, match=f"is not a policy file.\n  It is a {kind}, not a regular file"
    ):
        load_policy(path)


def test_a_policy_of_too_many_gates_is_refused(
    tmp_path: Path, values: Make, write_json: Make
) -> None:
    circuits = [[["h"]] * 50_001, [["h"]] * 50_000]
    with pytest.raises(PolicyError, match="circuits: more than 100,000 gates"):
        load_policy(write_json(tmp_path / "p.json", values() | {"circuits": circuits}))


def test_one_fault_of_a_long_list_is_enough(tmp_path: Path, values: Make, write_json: Make) -> None:
    """A million faults, a kilobyte each, are not collected."""
    for key, value in {"theta": ["x"] * 1000, "weights": [["x"] * 1000] * 2}.items():
        with pytest.raises(PolicyError) as caught:
            load_policy(write_json(tmp_path / "p.json", values() | {key: value}))
        assert len(str(caught.value).splitlines()) == 2


def test_tensors_of_too_many_numbers_are_refused(
    tmp_path: Path, values: Make, write_pt: Make
) -> None:
    large = torch.zeros(1_000_001, dtype=torch.uint8)
    with pytest.raises(PolicyError, match="tensors of more than 1,000,000 numbers"):
        load_policy(write_pt(tmp_path / "p.pt", values() | {"theta": large}))
