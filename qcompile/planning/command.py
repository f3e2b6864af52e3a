"""The command that plays what a plan found, as it is typed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from shlex import quote
from typing import Any

from qcompile.deploy.settings import RunSettings
from qcompile.planning.point import Point


def run_command(
    point: Point,
    policy: str,
    backend: str,
    imports: Sequence[str] = (),
    env: Mapping[str, Any] | None = None,
) -> str:
    """`qcompile run` with the settings of the point; `policy` and `backend` as they were named.

    Nothing in it needs quotes, but names of files with blanks or the like, which have them.
    """
    settings = point.settings
    usual = RunSettings.of(settings, mitigation=None).resolved(point.device)
    words = ["qcompile", "run", policy, "--backend", backend]
    options: dict[str, Any] = {
        "episodes": point.episodes,
        "seed": settings.seed or None,
        "shots": settings.shots,
        "copies": settings.copies if (settings.copies or 1) > 1 else None,
        "speculate": point.speculate,
        "calibration-shots": settings.calibration_shots,
        "mitigation": None if usual.mitigation == settings.mitigation else settings.mitigation,
        "calibration": settings.calibration_file,
        "max-steps": settings.max_steps,
        "level": settings.level if settings.level != 2 else None,
    }
    if not point.simulated.calibration.jobs:
        options["calibration-shots"] = None
    for name, value in options.items():
        words += [] if value is None else [f"--{name}", str(value)]
    words += ["--split"] if settings.split else []
    words += [word for module in imports for word in ("--import", module)]
    for name, value in (env or {}).items():
        words += ["--env", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    return " ".join(map(quote, words))
