"""Format 2: supported parts are read, written and played; unsupported ones are refused by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.device import load_device
from qcompile.errors import PolicyError
from qcompile.ir import Circuit
from qcompile.live.play import RunTask
from qcompile.policy import Policy, load_policy, save_policy
from qcompile.policy.files import policy_values
from qcompile.policy.refusals import UnsupportedPolicyError
from qcompile.sweep.evaluation.grid import policy_sha256

Make = Callable[..., Any]

SUFFIXES = (".json", ".pt")
BLOCK = {"qubits": 2, "gates": [["h", 0], ["ry", "x0", 1], ["cz", 0, 1], ["rx", 0.5, 0]]}

ARRAYS = ("gain", "mean", "std")


@pytest.fixture
def values(values: Make) -> Make:
    """The valid file of format 1, as one of format 2."""
    return lambda **more: values() | {"format": "qcompile-policy-2"} | more


def rich(awkward: Policy) -> Policy:
    """A policy with all of format 2 that this version runs."""
    rng = np.random.default_rng(7)
    encoder = replace(
        awkward.encoder,
        function=("clip", "arctan", "identity"),
        gain=rng.normal(size=3),
        mean=rng.normal(size=8),
        std=rng.uniform(0.5, 2, size=8),
    )
    return replace(
        awkward, encoder=encoder, environment_kwargs={"enable_wind": True, "gravity": -9.5}
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_policy_of_format_2_reads_back_equal(tmp_path: Path, suffix: str, awkward: Make) -> None:
    policy, path = rich(awkward()), tmp_path / f"p{suffix}"
    save_policy(policy, path)
    again = load_policy(path)
    assert policy_values(again) == policy_values(policy)
    assert policy_values(policy)["format"] == "qcompile-policy-2"
    assert again.encoder.function == policy.encoder.function
    assert again.environment_kwargs == policy.environment_kwargs
    for name in ("feature", "scale", *ARRAYS):
        found, saved = getattr(again.encoder, name), getattr(policy.encoder, name)
        assert (found.dtype, found.tobytes()) == (saved.dtype, saved.tobytes())
    assert policy_sha256(again) == policy_sha256(policy) != policy_sha256(awkward())


@pytest.mark.parametrize(
    ("change", "written"),
    [
        ({"function": "clip"}, {"function": "clip"}),
        ({"function": ("tanh", "tanh", "clip")}, {"function": ["tanh", "tanh", "clip"]}),
        ({"gain": np.array([1.0, 2.0, 1.0])}, {"gain": [1.0, 2.0, 1.0]}),
        ({"mean": np.arange(8.0)}, {"mean": [*range(8)]}),
        ({"std": np.full(8, 2.0)}, {"std": [2.0] * 8}),
    ],
)
def test_a_file_has_no_more_of_format_2_than_it_needs(
    change: dict[str, Any], written: dict[str, Any], awkward: Make
) -> None:
    policy = awkward()
    first, second = policy_values(policy), replace(policy.encoder, **change)
    found = policy_values(replace(policy, encoder=second))
    encoder = first["encoder"] | written
    assert found == first | {"format": "qcompile-policy-2", "encoder": encoder}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_format_1_can_say_is_written_in_it(tmp_path: Path, suffix: str, awkward: Make) -> None:
    plain = awkward()
    neutral = {"gain": np.ones(3), "mean": np.zeros(8), "std": np.ones(8)}
    encoder = replace(plain.encoder, function=("arctan",) * 3, **neutral)
    path = tmp_path / f"p{suffix}"
    save_policy(replace(plain, encoder=encoder), path)
    load = json.loads if suffix == ".json" else partial(torch.load, weights_only=True)
    document = load(path.read_bytes() if suffix == ".json" else path)
    assert document["format"] == "qcompile-policy-1"
    assert document["encoder"] == policy_values(plain)["encoder"]
    assert policy_values(load_policy(path)) == policy_values(plain)


KEPT = Path(__file__).parents[1] / "kept/trained"
BEFORE_FORMAT_2 = {
    "acrobot": "7cb02ad3752cff1ca2d3e9d1209ba04eae1401f1b925d75ffbcab32fa7770e7b",
    "cartpole": "82fa1aa644fdfcc65e36472a684035746489ec30f1a3229e4dafa97aea9b808e",
    "cartpole_1q": "7eaa7761794a42945b4372e3c8e8e417003205f700516f09ff3f12f2ea1e0e2c",
    "lunarlander": "9dd01e617d49200267c2cd4107a3dac5ad1ee70c7b5045a1bbc3bba1a8125f8d",
}
"""SHA-256 of the values of the policies that version 0.1.0 shipped, computed before format 2."""


@pytest.mark.parametrize("name", BEFORE_FORMAT_2)
def test_policies_have_the_hash_that_kept_cells_know(name: str) -> None:
    assert policy_sha256(load_policy(KEPT / f"{name}.pt")) == BEFORE_FORMAT_2[name]


def test_awkward_numbers_have_the_hash_that_they_had(awkward: Make) -> None:
    expected = "2c5232a40665d8e5084bae93ca646e7780d63bebad596d072ddd02d92c30939e"
    assert policy_sha256(awkward()) == expected


def test_a_task_holds_a_policy_of_either_format(awkward: Make) -> None:
    """A journal stores format 1 with the same bytes as before, and format 2 completely."""
    settings = {
        "backend": "fake_lima",
        "device": load_device("fake_lima"),
        "shots": 1,
        "episodes": 1,
    }
    settings |= {"seed": 0, "level": 2, "mitigation": "none"}
    for policy in (awkward(), rich(awkward())):
        task = RunTask.model_validate(settings | {"policy": policy_values(policy)})
        dumped = json.loads(json.dumps(task.model_dump(mode="json")))
        again = RunTask.model_validate(dumped).policy.policy()
        assert policy_values(again) == policy_values(policy)
        if policy_values(policy)["format"] == "qcompile-policy-1":
            assert json.dumps(dumped["policy"]) == json.dumps(policy_values(policy))


def test_blocks_of_one_qubit_and_single_observables_are_circuits(
    tmp_path: Path, values: Make, write_json: Make
) -> None:
    circuits = [{"qubits": 1, "gates": [["h", 0], ["ry", "x0", 0]]}, [["rx", "0.5*x1+theta0"]]]
    more = {"circuits": circuits, "observables": [[0], [1]], "decision": "softmax", "hold": 1}
    policy = load_policy(write_json(tmp_path / "p.json", values(**more)))
    expected = (Circuit.parse("h ry(x0)"), Circuit.parse("rx(0.5*x1+theta0)"))
    assert policy.program.circuits == expected
    assert policy_values(policy)["format"] == "qcompile-policy-1"


WIDE = {"circuits": [BLOCK, [["h"]]], "weights": [[0.0] * 6] * 2}
PRODUCTS = WIDE | {"observables": [[0, 1], [2]], "weights": [[0.0] * 4] * 2}
REFUSED: list[tuple[dict[str, Any], list[str]]] = [
    (
        {"decision": decision},
        [f"decision {decision}: this version draws actions from the softmax of the outputs."],
    )
    for decision in ("values", "born", "gaussian")
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("change", [WIDE, PRODUCTS, {"observables": [[1], [0]]}])
def test_blocks_of_several_qubits_and_products_are_read_and_written(
    tmp_path: Path, suffix: str, change: dict[str, Any], values: Make, write_json: Make
) -> None:
    policy = load_policy(write_json(tmp_path / "p.json", values(**change)))
    expected = [[0], [1], [2]][: policy.program.bits]
    assert policy.program.measured == tuple(map(tuple, change.get("observables", expected)))
    if "circuits" in change:
        assert policy.program.circuits == (Circuit.of(BLOCK["gates"], 2), Circuit.parse("h"))
    save_policy(policy, tmp_path / f"again{suffix}")
    again = load_policy(tmp_path / f"again{suffix}")
    assert (again.program, policy_values(again)) == (policy.program, policy_values(policy))
    assert policy_values(again)["format"] == "qcompile-policy-2"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("change", "lines"), REFUSED)
def test_what_cannot_run_yet_is_named(
    tmp_path: Path, suffix: str, change: dict[str, Any], lines: list[str], values: Make,
    write_json: Make, write_pt: Make,
) -> None:  # fmt: skip
    write = write_json if suffix == ".json" else write_pt
    path = write(tmp_path / f"p{suffix}", values(**change))
    with pytest.raises(UnsupportedPolicyError) as caught:
        load_policy(path)
    what = f"{path} is a policy that this version cannot run."
    assert str(caught.value).splitlines() == [what, *(f"  {line}" for line in lines)]


def gates(*of_block: list[Any]) -> dict[str, Any]:
    return WIDE | {"circuits": [{"qubits": 2, "gates": [*of_block]}, [["h"]]]}


def observables(*sets: list[int]) -> dict[str, Any]:
    return WIDE | {"observables": [*sets], "weights": [[0.0] * 2 * len(sets)] * 2}


WRONG: list[tuple[dict[str, Any], str]] = [
    (gates(["cx", 0, 0]), "gates.0: Gate 'cx' must end with two different qubits"),
    (gates(["h", 0], ["cz", 1]), "gates.1: Gate 'cz' must end with two different qubits"),
    (gates(["h"]), "circuits.0.gates.0: Gate 'h' must end with a qubit"),
    (gates(["ecr", 0, 2]), "Gate 'ecr' acts on 2.\n    The block has qubits 0 to 1"),
    (gates(["ry", 0, "x0"]), "Gate 'ry' acts on 'x0'.\n    The block has qubits 0 to 1; a gate"),
    (gates(["h", 0.0]), "Gate 'h' acts on 0.0"),
    (gates(["cz", "x0", 0, 1]), "Gate 'cz' has 1 angles"),
    (gates(["swap", 0]), "Unknown gate 'swap'"),
    (gates(["ry", "x7", 0]), "circuits.0.gates.0: Unknown symbol 'x7'"),
    (gates(["ry", "x0*x1", 0]), "'x0\\*x1' is not an affine angle"),
    (gates([]), "is not a gate"),
    (gates([3, 0]), "is not a gate"),
    (WIDE | {"circuits": [BLOCK | {"qubits": 0}]}, "circuits.0.block.qubits: .* or equal to 1"),
    (WIDE | {"circuits": [BLOCK | {"qubit": 2}]}, "qubit: unknown key .*\n  Did you mean qubits?"),
    (WIDE | {"circuits": [BLOCK, [["ry", "x9"]]]}, "Unknown symbol 'x9'"),
    (WIDE | {"weights": [[0.0] * 4] * 2}, r"weights has shape \(2, 4\).\n    It needs \(2, 6\)"),
    (observables([0, 3]), "observables.0 has bit 3.\n    The circuits have bits 0 to 2"),
    (observables([1, 1]), "observables.0 has a bit twice"),
    (observables([0], [1, 2]), "observables.1 has bits of more than one circuit"),
    (observables([]), "observables.0: list should have at least 1 item"),
    ({"observables": []}, "observables: list should have at least 1 item"),
    ({"decision": "argmax"}, "decision: input should be 'softmax', 'values', 'gaussian' or 'born'"),
    ({"hold": 0}, "hold: input should be greater than or equal to 1"),
    ({"hold": 1.0}, "hold: input should be a valid integer"),
    ({"holds": 2}, "holds: unknown key .*\n  Did you mean hold?"),
    ({"environment_kwargs": []}, "environment_kwargs: input should be an object"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), WRONG)
def test_wrong_values_of_format_2_are_named(
    tmp_path: Path, change: dict[str, Any], message: str, values: Make, write_json: Make
) -> None:
    path = write_json(tmp_path / "p.json", values(**change))
    with pytest.raises(PolicyError, match=message) as caught:
        load_policy(path)
    assert str(caught.value).startswith(f"{path} is not a policy file.")


ENCODER = {"function": "tanh", "feature": [3, 0], "scale": [1, 0.5]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"function": "sin"}, "encoder.function.name: input should be 'arctan', .*'bits' .found"),
        ({"function": ["tanh", "sin"]}, "encoder.function.list.1: input should be 'arctan'"),
        ({"function": ["tanh"]}, "encoder.function has 1 names"),
        ({"function": 3}, "encoder.function.name"),
        ({"gain": [1, "2"]}, "encoder.gain.1: input should be a valid number"),
        ({"std": [1, 1, 1, 0]}, "encoder.std contains a number that is not positive"),
        ({"gains": [1, 1]}, "encoder.gains: unknown key .*\n  Did you mean gain?"),
    ],
)
def test_wrong_encoders_are_named(
    tmp_path: Path, change: dict[str, Any], message: str, values: Make, write_json: Make
) -> None:
    path = write_json(tmp_path / "p.json", values(encoder=ENCODER | change))
    with pytest.raises(PolicyError, match=message):
        load_policy(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hold": 1}, 'hold: unknown key .*\n  It is valid in the other format: .*policy-2"'),
        ({"encoder": ENCODER | {"function": "clip"}}, "\n  It is valid in the other format"),
        ({"hold": 1, "bias": 3}, 'bias: .*\n  hold: .*\n  hold belongs to format "qcompile-pol'),
        (
            {"format": "qcompile-policy-3"},
            "should be 'qcompile-policy-1', 'qcompile-policy-2' or 'qcompile-network-1'",
        ),
        (
            {"format": ["qcompile-policy-1"]},
            "should be 'qcompile-policy-1', 'qcompile-policy-2' or 'qcompile-network-1'",
        ),
    ],
)
def test_a_file_of_another_format_is_told_which(
    tmp_path: Path, change: dict[str, Any], message: str, values: Make, write_json: Make
) -> None:
    path = write_json(tmp_path / "p.json", values(format="qcompile-policy-1") | change)
    with pytest.raises(PolicyError, match=message):
        load_policy(path)


def test_the_documented_example_is_read(tmp_path: Path) -> None:
    """Input 1 of (0, 0, 0.02, 0.4) is 1.57 times clip(0.3 / 0.5), input 0 arctan(10 * 0.4)."""
    page = Path(__file__).parents[2] / "docs" / "reference" / "policies.md"
    (example,) = (part for part in page.read_text().split("```") if "gain" in part and "{" in part)
    path = tmp_path / "p.json"
    path.write_text(example.removeprefix("json"))
    x = load_policy(path).encode([[0.0, 0.0, 0.02, 0.4]])
    np.testing.assert_allclose(x, [[math.atan(4.0), 1.57 * 0.6]], rtol=1e-14)
