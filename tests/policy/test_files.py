"""Policy files: what is written reads back, and what is wrong is refused in words."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.errors import OutputError, PolicyError
from qcompile.ir import Angle, Circuit, Program
from qcompile.policy import Encoder, Policy, load_policy, policy_names, save_policy
from qcompile.simulate import Simulator

SUFFIXES = (".json", ".pt")


def values() -> dict[str, Any]:
    """A valid file: two circuits over two features, two actions, output reuse 2."""
    return {
        "format": "qcompile-policy-1",
        "name": "small",
        "environment": "CartPole-v1",
        "encoder": {"function": "tanh", "feature": [3, 0], "scale": [1, 0.5]},
        "circuits": [
            [["h"], ["ry", "x0"], ["rz", "0.5*x1+theta0-1.57"]],
            [["h"], ["ry", "x1"], ["rz", "x1"], ["rx", 0.25]],
        ],
        "theta": [0.1],
        "weights": [[0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]],
        "bias": [0.0, -1.0],
        "reuse": 2,
    }


def write_json(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


def write_pt(path: Path, document: object) -> Path:
    torch.save(document, path)
    return path


def awkward() -> Policy:
    """A policy whose numbers have all their 53 bits."""
    rng = np.random.default_rng(0)
    return Policy(
        "awkward",
        "LunarLander-v3",
        Encoder("arctan", np.array([7, 2, 2]), rng.normal(size=3)),
        Program.of(
            [
                Circuit.parse("h ry(x0) rz(x0+0.1*theta1) sx"),
                Circuit.parse("p(-x1/3) tdg h rx(x2)"),
            ],
            3,
            2,
        ),
        rng.normal(size=2),
        rng.normal(size=(3, 8)) * 1e-9,
        rng.normal(size=3) * 1e9,
        4,
        {"seed": 3, "note": "trained\non a laptop", "scores": [1.5, None]},
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_policy_reads_back_equal(tmp_path: Path, suffix: str) -> None:
    policy, path = awkward(), tmp_path / f"p{suffix}"
    save_policy(policy, path)
    again = load_policy(path)
    for name in ("name", "environment", "program", "reuse", "metadata"):
        assert getattr(again, name) == getattr(policy, name)
    assert again.encoder.function == policy.encoder.function
    for found, saved in (
        (again.theta, policy.theta),
        (again.weights, policy.weights),
        (again.bias, policy.bias),
        (again.encoder.feature, policy.encoder.feature),
        (again.encoder.scale, policy.encoder.scale),
    ):
        np.testing.assert_array_equal(found, saved)
        assert found.dtype == saved.dtype
    z = np.random.default_rng(1).uniform(-1, 1, (5, 2))
    np.testing.assert_array_equal(again.probabilities(z), policy.probabilities(z))


def test_a_pt_file_holds_tensors_and_plain_values(tmp_path: Path) -> None:
    policy, path = awkward(), tmp_path / "p.pt"
    save_policy(policy, path)
    held = torch.load(path, weights_only=True)
    assert {k for k, v in held.items() if torch.is_tensor(v)} == {"theta", "weights", "bias"}
    np.testing.assert_array_equal(held["weights"].numpy(), policy.weights)
    assert held["format"] == "qcompile-policy-1"
    assert held["encoder"]["feature"] == [7, 2, 2]


def test_the_documented_example_loads(tmp_path: Path) -> None:
    """The form of the Acrobot file in the design notes, its ellipses filled."""
    circuits = [[["h"], ["ry", f"x{i}"], ["rz", f"x{i}"], ["ry", f"theta{i}"]] for i in range(6)]
    document = {
        "format": "qcompile-policy-1",
        "name": "acrobot",
        "environment": "Acrobot-v1",
        "encoder": {
            "function": "arctan",
            "feature": [0, 1, 2, 3, 4, 5],
            "scale": [1, 1, 1, 1, 1, 1],
        },
        "circuits": circuits,
        "theta": [0.1 * i for i in range(6)],
        "weights": [[1, 2, 3, 4, 5, 6], [0, 0, 0, 0, 0, 1], [0] * 6],
        "bias": [0, 0.5, 0],
        "reuse": 1,
    }
    policy = load_policy(write_json(tmp_path / "acrobot.json", document))
    assert (policy.name, policy.environment, policy.actions) == ("acrobot", "Acrobot-v1", 3)
    x = np.arctan([[0.3, -0.2, 0.9, 0.1, -4.0, 8.0]])
    theta = 0.1 * np.arange(6)
    expected = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)
    encoded = policy.encode([[0.3, -0.2, 0.9, 0.1, -4.0, 8.0]])
    z = Simulator(policy.program).expectation(encoded, policy.theta)
    np.testing.assert_allclose(z, expected, atol=1e-14)


def test_affine_angles_mean_what_they_say(tmp_path: Path) -> None:
    """rx((0.5 x1 + theta0 - 1.57)) from |0> measures the cosine of its angle."""
    document = values() | {"circuits": [[["rx", "0.5*x1+theta0-1.57"]]], "reuse": 4}
    policy = load_policy(write_json(tmp_path / "p.json", document))
    assert policy.program.circuits[0].gates[0].angle == Angle(-1.57, (("theta0", 1), ("x1", 0.5)))
    z = Simulator(policy.program).expectation(np.array([[9.0, 0.8]]), np.array([0.1]))
    assert z[0, 0] == pytest.approx(np.cos(0.5 * 0.8 + 0.1 - 1.57), abs=1e-15)


def test_reuse_and_metadata_may_be_left_out(tmp_path: Path) -> None:
    document = values() | {"weights": [[1, 2], [3, 4]]}
    del document["reuse"]
    policy = load_policy(write_json(tmp_path / "p.json", document))
    assert (policy.reuse, policy.metadata) == (1, {})


class Touch:
    """Pickled, this is code that makes a folder when it is opened."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("where", ["alone", "in a dict"])
def test_code_in_a_pickle_is_not_run(tmp_path: Path, where: str) -> None:
    marker = tmp_path / "marker"
    code = Touch(marker)
    path = write_pt(tmp_path / "p.pt", code if where == "alone" else values() | {"metadata": code})
    with pytest.raises(PolicyError, match="holds more than tensors and plain values") as caught:
        load_policy(path)
    assert "can carry code" in str(caught.value)
    assert "weights_only" not in str(caught.value)
    assert not marker.exists()
    torch.load(path, weights_only=False)
    assert marker.exists(), "the pickle carries no code: the test shows nothing"


def test_a_damaged_pt_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.pt"
    save_policy(awkward(), path)
    whole = path.read_bytes()
    for size in (0, 1, 4, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(PolicyError, match=r"cannot be read as a \.pt file; it may be"):
            load_policy(path)


def test_random_bytes_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for suffix in SUFFIXES:
        path = tmp_path / f"p{suffix}"
        for length in range(1, 200, 3):
            path.write_bytes(rng.bytes(length))
            with pytest.raises(
                PolicyError, match=rf"p\{suffix} (cannot be read|holds more|is no policy)"
            ):
                load_policy(path)


def test_random_opcodes_are_refused(tmp_path: Path) -> None:
    """Bytes that begin and end as a pickle: torch's reader fails with errors of many types."""
    rng, path = np.random.default_rng(1), tmp_path / "p.pt"
    for _ in range(200):
        path.write_bytes(b"\x80\x02" + rng.bytes(int(rng.integers(1, 30))) + b".")
        with pytest.raises(PolicyError, match=r"p\.pt"):
            load_policy(path)


def test_a_pt_file_of_something_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="holds a list"):
        load_policy(write_pt(tmp_path / "list.pt", [values()]))
    with pytest.raises(PolicyError, match="holds a Tensor"):
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
    tmp_path: Path, tensor: torch.Tensor, message: str
) -> None:
    with pytest.raises(PolicyError, match=message):
        load_policy(write_pt(tmp_path / "p.pt", values() | {"weights": tensor}))


def test_tensors_of_any_real_type_are_read(tmp_path: Path) -> None:
    for dtype in (torch.float16, torch.float32, torch.bfloat16, torch.int64):
        weights = torch.tensor([[1, 2, -3, 0], [0, 0, 4, 0]], dtype=dtype)
        policy = load_policy(write_pt(tmp_path / "p.pt", values() | {"weights": weights}))
        np.testing.assert_array_equal(policy.weights, [[1, 2, -3, 0], [0, 0, 4, 0]])


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
    ({"circuits": [[["cx"]], [["h"]]]}, "circuits.0: Unknown gate 'cx'"),
    ({"circuits": [[["h"]], [["ry"]]]}, "circuits.1"),
    ({"circuits": [[["h", 1.0]], [["h"]]]}, "circuits.0"),
    ({"circuits": [[["ry", "x0*x1"]], [["h"]]]}, "circuits.0: 'x0\\*x1' is no affine angle"),
    ({"circuits": [[["ry", "x5"]], [["h"]]]}, "Unknown symbol 'x5'"),
    ({"circuits": [[["ry", 1, 2]], [["h"]]]}, "circuits.0"),
    ({"circuits": [[[]], [["h"]]]}, "circuits.0"),
    ({"circuits": [["h"], [["h"]]]}, "circuits.0.0"),
    ({"encoder": ENCODER | {"function": "sin"}}, "encoder.function"),
    ({"encoder": ENCODER | {"feature": [-1, 0]}}, "encoder.feature.0"),
    ({"encoder": ENCODER | {"feature": [0.5, 0]}}, "encoder.feature.0"),
    ({"encoder": ENCODER | {"scale": [1]}}, r"encoder.scale has shape \(1,\)"),
    ({"encoder": ENCODER | {"offset": [1]}}, "encoder.offset: extra inputs are not permitted"),
    ({"encoder": None}, "encoder"),
    ({"extra": 1}, "extra: extra inputs are not permitted"),
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("change", "message"), WRONG)
def test_wrong_values_are_named(
    tmp_path: Path, suffix: str, change: dict[str, Any], message: str
) -> None:
    write = write_json if suffix == ".json" else write_pt
    path = write(tmp_path / f"wrong{suffix}", values() | change)
    with pytest.raises(PolicyError, match=message) as caught:
        load_policy(path)
    assert str(caught.value).startswith(f"{path} is no policy file.")


@pytest.mark.parametrize("key", [k for k in values() if k != "reuse"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    document = values()
    del document[key]
    with pytest.raises(PolicyError, match=f"{key}: field required"):
        load_policy(write_json(tmp_path / "p.json", document))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
@pytest.mark.parametrize("key", ["theta", "bias", "weights", "scale", "angle"])
def test_a_number_that_is_not_finite_is_refused(tmp_path: Path, key: str, number: str) -> None:
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
    with pytest.raises(PolicyError, match="is no policy file"):
        load_policy(path)


@pytest.mark.parametrize("text", ["", "[]", "3", "null", "{", '{"format": 1', "\ufeff{}"])
def test_text_that_is_no_policy_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "p.json"
    path.write_text(text)
    with pytest.raises(PolicyError, match="is no policy file"):
        load_policy(path)


def test_deep_nesting_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    path.write_text("[" * 100_000)
    with pytest.raises(PolicyError, match="is no policy file"):
        load_policy(path)


def test_an_unknown_name_gets_the_nearest_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_everything_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    old = tmp_path / f"old{suffix}"
    save_policy(awkward(), old)
    before = old.read_bytes()
    monkeypatch.setattr(os, "replace", full)
    for path in (old, tmp_path / f"new{suffix}"):
        with pytest.raises(OutputError, match=r"Cannot write .*\n.*No space left"):
            save_policy(awkward(), path)
    assert [path.name for path in tmp_path.iterdir()] == [old.name]
    assert old.read_bytes() == before


def test_a_folder_that_cannot_be_made_is_explained(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="Cannot write"):
        save_policy(awkward(), tmp_path / "file" / "p.json")
    with pytest.raises(OutputError, match="Cannot write"):
        save_policy(awkward(), Path("/proc/none/p.pt"))


def test_missing_folders_are_made(tmp_path: Path) -> None:
    save_policy(awkward(), tmp_path / "a" / "b" / "p.pt")
    assert load_policy(tmp_path / "a" / "b" / "p.pt").name == "awkward"


@pytest.mark.parametrize("name", ["p", "p.txt", "p.JSON", "p.pth"])
def test_another_suffix_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(PolicyError, match=r"It ends with \.pt or \.json"):
        save_policy(awkward(), tmp_path / name)
    assert not list(tmp_path.iterdir())


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
    ({"name": "two\nlines"}, "name: string should match"),
    ({"name": "\x1b[2J"}, "name: string should match"),
    ({"name": ""}, "name: string should match"),
    ({"environment": "CartPole-v1\x07"}, "environment: string should match"),
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("change", "message"), STRICT)
def test_values_are_what_they_look_like(
    tmp_path: Path, suffix: str, change: dict[str, Any], message: str
) -> None:
    test_wrong_values_are_named(tmp_path, suffix, change, message)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_path_may_be_a_text(tmp_path: Path, suffix: str) -> None:
    path = str(tmp_path / f"p{suffix}")
    save_policy(awkward(), path)
    assert load_policy(path).theta.tolist() == awkward().theta.tolist()


NEVER_READ_BACK: dict[str, dict[str, Any]] = {
    "a symbol of its own": {
        "program": Program(
            tuple(Circuit.parse(f"ry(alpha) rx({s})") for s in ("b", "c")),
            ("alpha", "b", "c"),
            ("theta0", "theta1"),
        )
    },
    "an array in the metadata": {"metadata": {"scores": np.zeros(3)}},
    "a path in the metadata": {"metadata": {"log": Path("log")}},
    "a newline in the name": {"name": "two\nlines"},
    "no name": {"name": ""},
    "a control character in the environment": {"environment": "CartPole-v1\x1b"},
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("what", NEVER_READ_BACK)
def test_a_policy_that_would_not_read_back_is_not_written(
    tmp_path: Path, suffix: str, what: str
) -> None:
    policy = replace(awkward(), **NEVER_READ_BACK[what])
    with pytest.raises(PolicyError, match="cannot be written to a file") as caught:
        save_policy(policy, tmp_path / f"p{suffix}")
    assert len(str(caught.value).splitlines()) > 1, "it does not say why"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_reads_back(tmp_path: Path, suffix: str) -> None:
    """JSON knows neither tuples nor numbers as keys; both kinds of file agree on what is left."""
    policy = replace(awkward(), metadata={"scores": (1.5, 2), 7: "seven"})
    save_policy(policy, tmp_path / f"p{suffix}")
    again = load_policy(tmp_path / f"p{suffix}")
    assert again.metadata == {"scores": [1.5, 2], "7": "seven"}
    assert again.program == policy.program
