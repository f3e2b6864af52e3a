"""The settings of a live run: the explicit ones, and the plan's for all others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qcompile.caller import option
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.execution.backend import DeviceBackend
from qcompile.planning.command import option_words
from qcompile.planning.search import Goal, search
from qcompile.policy import Policy
from qcompile.report import progress as bars
from qcompile.sweep.arguments import Planned, Words

_WITHOUT_A_PLAN = {"speculate": "auto", "calibration_shots": "auto"}
"""Defaults of a live run with explicit shots."""


def offline(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values, with the defaults of offline runs for those that are not explicit."""
    return {
        name: value.offline if isinstance(value, Planned) else value
        for name, value in values.items()
    }


def explicit_only(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values that the user set."""
    return {
        name: value
        for name, value in values.items()
        if not (value is None or isinstance(value, Planned))
    }


def live_settings(
    policy: Policy,
    device: Device,
    settings: RunSettings,
    explicit: Mapping[str, Any],
    episodes: int,
    limit_s: float,
    on_note: Words,
) -> RunSettings:
    """The settings of a live run of the policy, filled in by a plan.

    `explicit` are those of shots, copies, split, speculate, calibration_shots and max_steps that
    the user set. Without shots, the cheapest settings within `limit_s` QPU seconds are planned,
    less the one second that a run keeps in reserve; if nothing fits, the nearest are taken.
    `on_note` is told what the plan proposes.

    Raises:
        OptionError: the policy is not better than random actions, so nothing can be planned.
    """
    resolved = settings.resolved(device)
    if "shots" in explicit:
        changes = {"copies": settings.copies, **_WITHOUT_A_PLAN, **explicit}
        return RunSettings.of(resolved, **changes)
    goal = Goal(resolved, episodes, max(limit_s - 1, 0), fixed=dict(explicit))
    with bars.progress_bar(f"planning for {device.name}", 1.0) as show:
        result = search([policy], DeviceBackend(device), goal, show)
    point = result.recommended or result.closest
    options = " ".join(option_words(point))
    words = f"{options}, which keep {100 * point.share:.0f} % of the reward"
    if result.recommended is None:
        on_note(
            f"Planned settings: nothing fits the limit. The nearest are {words} and may need "
            f"{point.most_seconds:.0f} QPU seconds."
        )
    else:
        on_note(f"Planned settings: {words}. To choose others, add {option('shots')}.")
    return point.settings
