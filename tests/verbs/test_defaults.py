"""A command and its function take the same options, with the same defaults."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import pytest

import qcompile
from qcompile.deploy.settings import RunSettings
from qcompile.sweep.arguments import Planned
from qcompile.verbs.calibrate import calibrate_into, check_calibration
from qcompile.verbs.calibration_request import CalibrationRequest
from qcompile.verbs.evaluate import evaluate_paper

LEAST = {
    "train": ["CartPole-v1", "--out", "p.pt"],
    "calibrate": ["--backend", "fake_lima"],
    "validate": ["lima.json"],
}
"""What each command has to be told; nothing, where it is not named."""
RENAMED = {"calibration_file": "calibration", "file": "calibration"}
SHOWN = {"as_json", "traceback", "listing", "plot", "style", "table", "report"}
"""What the command line alone decides: how the answer is shown, and what of it is saved."""
LIVE = {
    "live",
    "max_qpu_seconds",
    "yes",
    "account",
    "instance",
    "batch",
    "jobs_per_minute",
    "max_wait_seconds",
    "runs",
}
EMPTY: tuple[object, ...] = (None, (), {})


def options(name: str) -> dict[str, Any]:
    """The values that a command has where it is told nothing more than it must be."""
    command: click.Command = import_module(f"qcompile.cli.{name}").command
    names = ["-h", "--help"]  # as the group has them: click keeps the first it is told
    context = command.make_context(name, [*LEAST.get(name, [])], help_option_names=names)
    return dict(context.params)


def defaults(function: Callable[..., Any]) -> dict[str, Any]:
    parameters = inspect.signature(function).parameters.values()
    return {p.name: p.default for p in parameters}


def same(value: Any, other: Any) -> bool:
    other = other.offline if isinstance(other, Planned) else other
    if isinstance(value, Path):
        value = str(value)
    return value == other or (value in EMPTY and other in EMPTY)


@pytest.mark.parametrize("name", ["run", "plan", "train", "validate", "study"])
def test_a_command_has_the_defaults_of_its_function(name: str) -> None:
    known = defaults(getattr(qcompile, name))
    for option, value in options(name).items():
        if option in SHOWN or (option in LIVE and name != "plan") or option == "environment":
            continue
        parameter = RENAMED.get(option, option)
        assert parameter in known, f"{name} in Python has no {parameter}"
        if known[parameter] is not inspect.Parameter.empty and (name, option) != ("train", "out"):
            assert same(value, known[parameter]), (option, value, known[parameter])


def test_a_function_takes_nothing_that_its_command_cannot_say() -> None:
    python = {"progress", "on_note", "sampler", "live", "callback"}
    for name in ("run", "plan", "train", "validate", "study"):
        told = {RENAMED.get(option, option) for option in options(name)}
        assert set(defaults(getattr(qcompile, name))) - python <= told, name


def test_a_grid_has_the_defaults_that_its_help_states() -> None:
    """On the command line nothing stands for the default of a side, which the help names."""
    known, words = defaults(qcompile.evaluate), options("evaluate")
    command = import_module("qcompile.cli.evaluate").command
    helps = {param.name: getattr(param, "help", "") for param in command.params}
    for side in ("backends", "shots", "mitigations", "levels"):
        assert words[side] in EMPTY
        stated = helps[side].rpartition("[default: ")[2].removesuffix("]")
        assert stated == ", ".join(map(str, known[side]))
    assert known["policies"] == ("lunarlander",)
    for option in ("episodes", "seed", "greedy", "engine", "address", "workers"):
        assert same(words[option], known[option]), option
    for option in ("episodes", "seed", "engine", "address", "workers", "out", "page"):
        assert same(words[option], defaults(evaluate_paper)[option]), option


def test_calibrations_have_the_same_defaults_everywhere() -> None:
    words, known = options("calibrate"), defaults(qcompile.calibrate)
    assert defaults(CalibrationRequest) == known
    for option in ("shots", "qubits", "policy", "parts", "seed"):
        assert same(words[option], known[option]), option
    for function in (calibrate_into, check_calibration):
        for option in ("out", "force", "plot"):
            assert same(words[option], defaults(function)[option]), option


def test_the_settings_of_a_run_are_those_of_its_record() -> None:
    known = defaults(qcompile.run)
    for name, value in RunSettings().values.items():
        if name != "calibration_file":
            assert same(value, known[name]), name


def test_a_live_run_has_the_defaults_of_its_options() -> None:
    words, known = options("run"), defaults(qcompile.Live)
    renamed = {"max_wait_seconds": "max_wait_s"}
    for option in LIVE - {"live", "yes", "max_qpu_seconds"}:
        assert same(words[option], known[renamed.get(option, option)]), option
