"""The settings of a live run: those that are given, and the plan's for the others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.execution.backend import DeviceBackend
from qcompile.planning.command import option_words
from qcompile.planning.search import Goal, search
from qcompile.policy import Policy
from qcompile.report import progress as bars
from qcompile.sweep.arguments import Planned, Words

_WITHOUT_A_PLAN = {"speculate": "auto", "calibration_shots": "auto"}
"""What a live run takes where its shots are given."""


def offline(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values, with those of runs offline where nothing was said."""
    return {
        name: value.offline if isinstance(value, Planned) else value
        for name, value in values.items()
    }


def given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the values that somebody said."""
    return {
        name: value
        for name, value in values.items()
        if not (value is None or isinstance(value, Planned))
    }


def live_settings(
    policy: Policy,
    device: Device,
    settings: RunSettings,
    said: Mapping[str, Any],
    episodes: int,
    limit_s: float,
    on_note: Words,
) -> RunSettings:
    """The settings with what a live run of the policy takes where nothing was said.

    `said` are those of shots, copies, split, speculate, calibration_shots and max_steps that were.
    Without shots it is planned within `limit_s` QPU seconds, less the one that a run keeps to
    spare; `on_note` is told what the plan proposes. Where nothing fits it is the nearest.

    Raises:
        OptionError: the policy is no better than random actions, so that nothing can be planned.
    """
    resolved = settings.resolved(device)
    if "shots" in said:
        changes = {"copies": settings.copies, **_WITHOUT_A_PLAN, **said}
        return RunSettings.of(resolved, **changes)
    goal = Goal(resolved, episodes, max(limit_s - 1, 0), fixed=dict(said))
    with bars.progress_bar(f"planning for {device.name}", 1.0) as show:
        found = search([policy], DeviceBackend(device), goal, show)
    point = found.recommended or found.closest
    words = " ".join(option_words(point))
    kept = f"{words}, which keep {100 * point.share:.0f} % of the reward"
    if found.recommended is None:
        on_note(
            f"planned: nothing fits; the nearest is {kept} and may take "
            f"{point.most_seconds:.0f} QPU seconds"
        )
    else:
        on_note(f"planned: {kept}; other settings: give --shots")
    return point.settings
