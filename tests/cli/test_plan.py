"""`qcompile plan` as a user meets it, without any service."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from qcompile.planning import search

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
    assert "IBM's published estimate, 2 per job and 0.00035 per execution" in answer.out
    assert "USD: 1.6 per QPU second" in answer.out


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


SMALL = ("plan", "cartpole_1q", "--episodes", 2, "--shots", 64, "--within", 60, "--json")


@pytest.fixture
def few_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings are judged by four episodes."""
    monkeypatch.setattr(search, "_LEAST", 4)
    monkeypatch.setattr(search, "_MOST", 4)


@pytest.mark.usefixtures("few_episodes")
@pytest.mark.parametrize("words", [(), ("--no-split", "--copies", 1), ("--level", 1)])
def test_the_command_does_what_the_plan_said(qcompile: Call, words: tuple[object, ...]) -> None:
    planned = qcompile(*SMALL, *words, "--within", 900, "--backend", "fake_lima").json()
    found = planned["recommended"]
    played = qcompile(*shlex.split(found["command"])[1:], "--json").json()
    assert played["jobs"] == pytest.approx(found["jobs"], rel=0.1)
    assert played["qpu_seconds_estimate"] == pytest.approx(found["qpu_seconds"], rel=0.1)
    for name in ("shots", "copies", "split", "speculate", "mitigation", "calibration_shots"):
        assert played[name] == found[name], name
    assert played["mean_reward"] == found["mean_reward"] == 500


@pytest.mark.usefixtures("few_episodes")
@pytest.mark.parametrize(
    "words", [("--backend", "lima.json"), ("--backend", "fake_lima", "--calibration", "lima.json")]
)
def test_a_calibration_that_is_there_costs_nothing(
    qcompile: Call, calibration: str, words: tuple[object, ...]
) -> None:
    assert calibration == "lima.json"
    answer = qcompile(*SMALL, "--within", 900, "--copies", 1, *words)
    assert answer.code == 0, answer.err
    planned = answer.json()
    assert planned["backend"] == "fake_lima"
    found = planned["recommended"]
    played = qcompile(*shlex.split(found["command"])[1:], "--json").json()
    assert played["calibration_shots"] is None
    assert played["qpu_seconds_estimate"] == pytest.approx(found["qpu_seconds"], rel=0.1)


@pytest.mark.usefixtures("few_episodes")
def test_the_page_of_a_plan_is_about_what_is_recommended(qcompile: Call, calibration: str) -> None:
    Path("clients").mkdir()
    held = Path(calibration).rename("clients/lima.json")
    words = (*SMALL, "--within", 900, "--backend", "fake_lima", "--calibration", held, "--split")
    answer = qcompile(*words, "--report", "a.html", "--plot", "a.svg", "--episodes", 1)
    assert answer.code == 0, answer.err
    chosen = answer.json()["recommended"]
    assert (chosen["copies"], chosen["split"]) == (5, True)
    page = unescape(Path("a.html").read_text())
    _, _, settings = page.partition('<h2 id="settings">')
    assert "<dt>shots</dt><dd>64</dd>" in settings
    assert "<dt>copies that share the shots</dt><dd>5</dd>" in settings
    assert "side by side</dt>" not in settings
    assert "5 copies side by side in" in page, "its placement"
    assert "clients/lima.json" in chosen["command"]
    assert chosen["command"].replace("clients/", "") in page
    assert "clients" not in page
    assert "1 episode on fake_lima" in Path("a.svg").read_text()


@pytest.mark.usefixtures("few_episodes")
def test_nothing_fits_in_a_second(qcompile: Call) -> None:
    answer = qcompile(*SMALL, "--within", 1)
    assert answer.code == 1
    planned = answer.json()
    assert planned["recommended"] is None
    assert planned["nearest"]["within"] > 1
    assert (
        "No settings keep 97 % of the reward within 1 QPU seconds. It would fit with " in answer.err
    )
