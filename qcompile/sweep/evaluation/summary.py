"""Every cell beside its policy's ideal, episode by episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.sweep.evaluation.cell import CellResult
from qcompile.sweep.evaluation.grid import Cell
from qcompile.sweep.pages import csv_text

_COLUMNS = (
    "policy",
    "environment",
    "backend",
    "device",
    "kind",
    "reference",
    "shots",
    "mitigation",
    "calibration",
    "level",
    "seed",
    "episodes",
    "mean_reward",
    "std_reward",
    "ci95_low",
    "ci95_high",
    "ideal_mean_reward",
    "paired_difference",
    "paired_std",
    "paired_ci95_low",
    "paired_ci95_high",
    "ratio_to_ideal",
    "threshold",
    "solved",
    "circuits_per_step",
    "rounds_per_step",
    "executions",
    "qpu_seconds_estimate",
    "hold",
    "decisions",
    "env_steps",
    "wall_seconds",
)


def compare(
    rewards: Mapping[int, float], ideal: Mapping[int, float] | None, seed: int
) -> dict[str, Any]:
    """The figures that set a cell beside the ideal; both map an episode's seed to its reward.

    The difference is the mean of (reward - ideal reward) over the episodes of both, with its
    standard deviation and 95 % interval. All are None without common episodes, the interval also
    with one alone, the ratio of the means also where the ideal's is not positive.
    """
    common = sorted(rewards.keys() & (ideal or {}).keys())
    figures: dict[str, Any] = dict.fromkeys(
        (
            "ideal_mean_reward",
            "paired_difference",
            "paired_std",
            "paired_ci95",
            "ratio_to_ideal",
        )
    )
    if not common or ideal is None:
        return figures
    cell, best = (np.array([of[episode] for episode in common]) for of in (rewards, ideal))
    differences, mean = cell - best, float(best.mean())
    return {
        "ideal_mean_reward": mean,
        "paired_difference": float(differences.mean()),
        "paired_std": float(differences.std()),
        "paired_ci95": bootstrap_ci95(differences, seed),
        "ratio_to_ideal": float(cell.mean()) / mean if mean > 0 else None,
    }


def results(cells: Sequence[Cell], played: Mapping[str, CellResult]) -> list[dict[str, Any]]:
    """One object a cell, in the order of `cells`: `qcompile run --json` and the comparison.

    `backend` and `calibration` are called as the cell calls them; `device` is the name of the
    backend's device, which a twin or a sampler may share with others. `played` holds the
    results by the names of the cells; a cell that it lacks is left out.
    """
    ideals = {cell.policy.name: played.get(cell.name) for cell in cells if cell.is_reference}
    objects = []
    for cell in cells:
        result, ideal = played.get(cell.name), ideals.get(cell.policy.name)
        if result is None:
            continue
        objects.append(
            {
                "hold": 1,
                "decisions": result.summary["env_steps"],  # cells of earlier versions say neither
                **result.summary,
                "backend": cell.backend.name,
                "device": cell.backend.device.name,
                "calibration": None if cell.calibration is None else cell.calibration.name,
                "reference": cell.is_reference,
                **compare(result.rewards, ideal.rewards if ideal else None, cell.seed),
                "threshold": result.threshold,
            }
        )
    return objects


def results_csv(objects: Sequence[Mapping[str, Any]]) -> str:
    """A row for each object of `results`; what is None is left empty."""
    lines = []
    for values in objects:
        row = dict(values) | {"episodes": len(values["episodes"])}
        for interval in ("ci95", "paired_ci95"):
            low, high = values[interval] or (None, None)
            row |= {f"{interval}_low": low, f"{interval}_high": high}
        lines.append([row[column] for column in _COLUMNS])
    return csv_text(_COLUMNS, lines)
