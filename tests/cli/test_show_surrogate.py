"""`qcompile show --surrogate`: the linear softmax policy that circuits compute."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]

PAGE = Path(__file__).parents[2] / "docs" / "background" / "surrogate.md"


def test_the_table_of_a_small_policy(qcompile: Call, policy: Call, left: Call) -> None:
    """With theta = -pi / 2 a circuit shows cos(x)^2 and nothing else."""
    changes = {
        "encoder": {"function": "arctan", "feature": [2, 3], "scale": [1.25, -3.0]},
        "circuits": [[["h"], ["ry", f"x{i}"], ["rz", f"x{i}"], ["ry", "theta0"]] for i in (0, 1)],
        "theta": [-math.pi / 2],
        "weights": [[2.0, 0.5], [-2.0, 0.25]],
        "bias": [0.125, 0.0],
    }
    answer = qcompile("show", policy(**changes), "--surrogate")
    assert (answer.code, answer.err, left()) == (0, "", ["tiny.json"])
    assert [line.rstrip() for line in answer.out.splitlines() if line.strip()] == [
        "tiny for CartPole-v1 is, without noise, a linear softmax policy on 2 fixed functions of",
        "the observation: its 2 circuits compute exactly this.",
        "surrogate: 2 x (2 weights + 1 bias) = 6 numbers, and the input scales",
        "policy: 9 trained numbers, input scales included",
        "  x0 = arctan(1.25 * observation[2])",
        "  x1 = arctan(-3 * observation[3])",
        "  term        action 0   action 1",
        " ─────────────────────────────────",
        "  cos(x0)^2          2         -2",
        "  cos(x1)^2        0.5       0.25",
        "  1 (bias)       0.125          0",
    ]


def test_equal_inputs_are_shown_as_one(qcompile: Call, policy: Call) -> None:
    encoder = {"function": "tanh", "feature": [1, 1, 1, 0], "scale": [2.0, 2.0, -2.0, 0.0]}
    answer = qcompile("show", policy(encoder=encoder), "--surrogate")
    assert "  x0 = tanh(2 * observation[1])\n" in answer.out
    assert "  x1 = x0 = tanh(2 * observation[1])\n" in answer.out
    assert "  x2 = -x0 = tanh(-2 * observation[1])\n" in answer.out
    assert "  x3 = 0.0 = tanh(0 * observation[0])\n" in answer.out
    assert "sin(x0)" in answer.out
    assert "sin(x1)" not in answer.out


def test_the_identity_is_not_written_out(qcompile: Call, policy: Call) -> None:
    encoder = {"function": "identity", "feature": [0, 1, 2, 3], "scale": [1.0] * 4}
    answer = qcompile("show", policy(encoder=encoder), "--surrogate")
    assert "  x3 = 1 * observation[3]\n" in answer.out


def test_json(qcompile: Call, policy: Call) -> None:
    answer = qcompile("show", policy(bias=[0.5, -0.25]), "--surrogate", "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert [*found] == ["policy", "environment", "inputs", "terms", "weights", "bias"]
    assert (found["policy"], found["environment"]) == ("tiny", "CartPole-v1")
    assert found["inputs"] == [
        {"input": f"x{i}", "feature": i, "scale": 1.0, "function": "arctan"} for i in range(4)
    ]
    assert found["terms"] == [t for i in range(4) for t in (f"sin(x{i})", f"cos(x{i})^2")]
    by_hand = [
        part * weight for weight in (1, 1, 2, 1) for part in (-math.cos(0.1), -math.sin(0.1))
    ]
    assert found["weights"][0] == pytest.approx(by_hand, rel=1e-14)
    assert found["weights"][1] == pytest.approx([-value for value in by_hand], rel=1e-14)
    assert found["bias"] == [0.5, -0.25]


def test_the_default_is_the_shipped_lunarlander(qcompile: Call) -> None:
    found = qcompile("show", "--surrogate", "--json").json()
    assert found["policy"] == "lunarlander"
    assert (len(found["terms"]), len(found["weights"]), len(found["bias"])) == (48, 4, 4)


def test_the_documentation_shows_what_is_printed(qcompile: Call) -> None:
    command, *shown = PAGE.read_text().split("```")[1].strip().splitlines()
    printed = {line.strip() for line in qcompile(*command.split()[1:]).out.splitlines()}
    assert len(shown) > 10
    assert {line.strip() for line in shown} - {"..."} <= printed


def test_a_policy_with_too_many_terms_is_explained(qcompile: Call, policy: Call) -> None:
    gates = [["h"], *([name, f"x{i}"] for i in range(12) for name in ("ry", "rz"))]
    encoder = {"function": "arctan", "feature": [0] * 12, "scale": [i + 1.0 for i in range(12)]}
    written = policy(encoder=encoder, circuits=[gates], weights=[[1.0], [0.0]])
    answer = qcompile("show", written, "--surrogate", "--json")
    assert (answer.code, answer.out) == (1, "")
    assert "Circuit 0 has too many terms for a surrogate." in answer.err
