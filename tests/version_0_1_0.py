"""Settings as version 0.1.0 had them, whose trainings are kept."""

from __future__ import annotations

from typing import Any

from qcompile.rl.settings import Settings, plain

ADDED = {
    "features": None,
    "encoder": None,
    "trainable_gain": False,
    "normalise": False,
    "average_share": 0.0,
    "rollouts": 1,
    "hold": 1,
    "decision_cost": 0.0,
    "temperature": 1.0,
}
"""Settings that it had not, and what all of its trainings have of them."""


def of_version_0_1_0(settings: Settings) -> dict[str, Any]:
    """The plain values of settings that it could have had."""
    values = plain(settings)
    assert values | ADDED == values
    return {name: value for name, value in values.items() if name not in ADDED}
