"""`qcompile plan` as a user meets it, without any service."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Call = Callable[..., Any]
WORDS = ("plan", "cartpole", "--max-steps", 2, "--shots", 100)


def test_the_contract_of_json(qcompile: Call) -> None:
    answer = qcompile(*WORDS, "--json")
    assert (answer.code, answer.err) == (0, "")
    ways = answer.json()["strategies"]
    assert ways[0]["name"] == "as in the paper"
    for way in ways:
        assert {"name", "jobs", "executions", "qpu_seconds", "price_usd"} <= set(way)
        assert isinstance(way["jobs"], int)
        assert isinstance(way["executions"], int)
        assert way["qpu_seconds"] == pytest.approx(2 * way["jobs"] + 0.00035 * way["executions"])
        assert way["price_usd"] == pytest.approx(1.6 * way["qpu_seconds"])


def test_the_table_says_where_its_figures_come_from(qcompile: Call) -> None:
    answer = qcompile(*WORDS)
    assert answer.code == 0
    for words in ("as in the paper", "packed, lockstep", "calibrate, play twin"):
        assert words in answer.out
    assert "IBM's published estimate, 2 for a job and 0.00035 for an execution" in answer.out
    assert "price: 1.6 USD a second" in answer.out


def test_a_price_of_zero(qcompile: Call) -> None:
    ways = qcompile(*WORDS, "--usd-per-second", 0, "--json").json()["strategies"]
    assert {way["price_usd"] for way in ways} == {0.0}


def test_ideal_is_no_machine(qcompile: Call) -> None:
    answer = qcompile(*WORDS, "--backend", "ideal")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == (
        "Error: ideal is not a machine: it costs nothing.\n"
        "  Name a device; `qcompile backends` lists some.\n"
    )


@pytest.mark.parametrize(
    "words",
    [("--shots", "exact"), ("--account", "mine"), ("--instance", "mine"), ("--episodes", 0)],
)
def test_wrong_usage(qcompile: Call, words: tuple[object, ...]) -> None:
    answer = qcompile(*WORDS, *words)
    assert (answer.code, answer.out) == (2, "")
