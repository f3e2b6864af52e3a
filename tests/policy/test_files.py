"""Policy files read back as written, and are written whole or not at all."""

from __future__ import annotations

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
from qcompile.policy import Encoder, Policy, load_policy, save_policy
from qcompile.simulate import Simulator

Make = Callable[..., Any]

SUFFIXES = (".json", ".pt")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_policy_reads_back_equal(tmp_path: Path, suffix: str, awkward: Make) -> None:
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


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_symbols_of_any_name_become_those_of_files(tmp_path: Path, suffix: str) -> None:
    circuits = (Circuit.parse("ry(s1) rz(x0)"), Circuit.parse("ry(2*theta0) rz(w+s1)"))
    program = Program(circuits, ("s1", "theta0"), ("w", "x0"))
    arrays = (np.array([0.25, 0.5]), np.ones((2, 2)), np.zeros(2))
    encoder = Encoder("tanh", np.array([0, 1]), np.ones(2))
    path = tmp_path / f"p{suffix}"
    save_policy(Policy("p", "CartPole-v1", encoder, program, *arrays), path)
    again = load_policy(path)
    assert [str(circuit) for circuit in again.program.circuits] == [
        "ry(x0) rz(theta1)",
        "ry(2.0*x1) rz(theta0+x0)",
    ]
    assert again.theta.tolist() == [0.25, 0.5]


def test_a_pt_file_holds_tensors_and_plain_values(tmp_path: Path, awkward: Make) -> None:
    policy, path = awkward(), tmp_path / "p.pt"
    save_policy(policy, path)
    held = torch.load(path, weights_only=True)
    assert {k for k, v in held.items() if torch.is_tensor(v)} == {"theta", "weights", "bias"}
    np.testing.assert_array_equal(held["weights"].numpy(), policy.weights)
    assert held["format"] == "qcompile-policy-1"
    assert held["encoder"]["feature"] == [7, 2, 2]


def test_the_documented_example_loads(tmp_path: Path, write_json: Make) -> None:
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


def test_affine_angles_mean_what_they_say(tmp_path: Path, values: Make, write_json: Make) -> None:
    """rx((0.5 x1 + theta0 - 1.57)) from |0> measures the cosine of its angle."""
    document = values() | {"circuits": [[["rx", "0.5*x1+theta0-1.57"]]], "reuse": 4}
    policy = load_policy(write_json(tmp_path / "p.json", document))
    assert policy.program.circuits[0].gates[0].angle == Angle(-1.57, (("theta0", 1), ("x1", 0.5)))
    z = Simulator(policy.program).expectation(np.array([[9.0, 0.8]]), np.array([0.1]))
    assert z[0, 0] == pytest.approx(np.cos(0.5 * 0.8 + 0.1 - 1.57), abs=1e-15)


def test_reuse_and_metadata_may_be_left_out(tmp_path: Path, values: Make, write_json: Make) -> None:
    document = values() | {"weights": [[1, 2], [3, 4]]}
    del document["reuse"]
    policy = load_policy(write_json(tmp_path / "p.json", document))
    assert (policy.reuse, policy.metadata) == (1, {})


def test_tensors_of_any_real_type_are_read(tmp_path: Path, values: Make, write_pt: Make) -> None:
    for dtype in (torch.float16, torch.float32, torch.bfloat16, torch.int64):
        weights = torch.tensor([[1, 2, -3, 0], [0, 0, 4, 0]], dtype=dtype)
        policy = load_policy(write_pt(tmp_path / "p.pt", values() | {"weights": weights}))
        np.testing.assert_array_equal(policy.weights, [[1, 2, -3, 0], [0, 0, 4, 0]])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_everything_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, awkward: Make
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


def test_a_folder_that_cannot_be_made_is_explained(tmp_path: Path, awkward: Make) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="Cannot write"):
        save_policy(awkward(), tmp_path / "file" / "p.json")
    with pytest.raises(OutputError, match="Cannot write"):
        save_policy(awkward(), Path("/proc/none/p.pt"))


def test_missing_folders_are_made(tmp_path: Path, awkward: Make) -> None:
    save_policy(awkward(), tmp_path / "a" / "b" / "p.pt")
    assert load_policy(tmp_path / "a" / "b" / "p.pt").name == "awkward"


@pytest.mark.parametrize("name", ["p", "p.txt", "p.JSON", "p.pth"])
def test_another_suffix_is_refused(tmp_path: Path, name: str, awkward: Make) -> None:
    with pytest.raises(PolicyError, match=r"It must end with \.pt or \.json"):
        save_policy(awkward(), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_path_may_be_a_text(tmp_path: Path, suffix: str, awkward: Make) -> None:
    path = str(tmp_path / f"p{suffix}")
    save_policy(awkward(), path)
    assert load_policy(path).theta.tolist() == awkward().theta.tolist()


NEVER_READ_BACK: dict[str, dict[str, Any]] = {
    "an array in the metadata": {"metadata": {"scores": np.zeros(3)}},
    "a path in the metadata": {"metadata": {"log": Path("log")}},
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("what", NEVER_READ_BACK)
def test_a_policy_that_would_not_read_back_is_not_written(
    tmp_path: Path, suffix: str, what: str, awkward: Make
) -> None:
    policy = replace(awkward(), **NEVER_READ_BACK[what])
    with pytest.raises(PolicyError, match="cannot be written to a file") as caught:
        save_policy(policy, tmp_path / f"p{suffix}")
    assert len(str(caught.value).splitlines()) > 1, "it does not say why"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("key", ["name", "environment"])
@pytest.mark.parametrize(
    "text", ["", "two\nlines", "a\x1b", "a\x9b", "a\uffff", "\U0001fffe", "\ud800"]
)
def test_a_name_is_a_line_of_characters_that_every_file_can_hold(
    key: str, text: str, awkward: Make
) -> None:
    with pytest.raises(PolicyError, match=f"{key} is .*\\n  It must be one line of text") as caught:
        replace(awkward(), **{key: text})
    str(caught.value).encode()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_reads_back(tmp_path: Path, suffix: str, awkward: Make) -> None:
    """JSON knows neither tuples nor numbers as keys; both kinds of file agree on what is left."""
    policy = replace(awkward(), metadata={"scores": (1.5, 2), 7: "seven"})
    save_policy(policy, tmp_path / f"p{suffix}")
    again = load_policy(tmp_path / f"p{suffix}")
    assert again.metadata == {"scores": [1.5, 2], "7": "seven"}
    assert again.program == policy.program
