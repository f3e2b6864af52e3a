"""The command that plays a plan's settings, ready to type."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from shlex import join
from typing import Any

from qcompile.deploy.settings import RunSettings
from qcompile.planning.point import Point


def option_words(point: Point) -> list[str]:
    """The options of `qcompile run` that the plan has chosen."""
    settings = point.settings
    measures = point.simulated.calibration.jobs > 0
    options: dict[str, Any] = {
        "shots": settings.shots,
        "copies": settings.copies if (settings.copies or 1) > 1 else None,
        "speculate": settings.speculate,
        "calibration-shots": settings.calibration_shots if measures else None,
        "max-steps": settings.max_steps,
    }
    return [*_words(options), *["--split"] * settings.split]


def run_command(
    point: Point,
    policy: str,
    backend: str,
    imports: Sequence[str] = (),
    env: Mapping[str, Any] | None = None,
    live: Mapping[str, Any] | None = None,
    named: Callable[[str], str] = str,
) -> str:
    """`qcompile run` with the settings of the point, and `policy` and `backend` as given.

    With `live`, the options of a live run, it plays on the machine. Only file names with spaces or
    similar characters are quoted. `named` is how names and files are written.
    """
    settings = point.settings
    file = settings.calibration_file
    usual = RunSettings.of(settings, mitigation=None).resolved(point.device)
    options: dict[str, Any] = {
        "seed": settings.seed or None,
        "mitigation": None if usual.mitigation == settings.mitigation else settings.mitigation,
        "calibration": None if file is None else named(file),
        "level": None if settings.level == 2 else settings.level,
    }
    words = ["qcompile", "run", named(policy), "--backend", named(backend)]
    words += ["--episodes", str(point.episodes)]
    words += option_words(point)
    words += _words(options)
    words += ["--live"] * bool(live) + _words(live or {})
    words += [word for module in imports for word in ("--import", named(module))]
    for name, value in (env or {}).items():
        words += ["--env", f"{name}={_value_word(value)}"]
    return join(words)


def _words(options: Mapping[str, Any]) -> list[str]:
    """The options and their values, without those that are None."""
    texts = [
        (name, f"{value:.12g}" if isinstance(value, float) else str(value))
        for name, value in options.items()
        if value is not None
    ]
    return [word for name, value in texts for word in (f"--{name}", value)]


def _value_word(value: Any) -> str:
    """The value in the form that `--env` reads: text unchanged, unless it would parse as JSON."""
    if isinstance(value, str) and value == value.strip():
        try:
            json.loads(value)
        except ValueError:
            return value
    return json.dumps(value)
