"""Compare every cell with its policy's ideal, episode by episode."""

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
    """The comparison of a cell with the ideal; both arguments map an episode's seed to its reward.

    The difference is the mean of (reward - ideal reward) over the episodes of both, with its
    standard deviation and 95 % interval. All are None without common episodes. The interval is also
    None with a single one, the ratio of the means also if the ideal's is not positive.
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
    """One object per cell, in the order of `cells`: that of `qcompile run --json`, and `compare`.

    `backend` and `calibration` are the names that the cell uses; `device` is the name of the
    backend's device, which a twin or a sampler may share with others. `played` has the results by
    cell name; cells without a result are left out.
    """
    ideals = {cell.policy.name: played.get(cell.name) for cell in cells if cell.is_reference}
    objects = []
    for cell in cells:
        result, ideal = played.get(cell.name), ideals.get(cell.policy.name)
        if result is None:
            continue
        objects.append(
            {
                # what earlier versions did not write
                "hold": 1,
                "decisions": result.summary["env_steps"],
                "couplings_per_circuit": 0,
                "observables_per_step": result.summary["circuits_per_step"],
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
    """A row for each object of `results`; None is an empty field."""
    lines = []
    for values in objects:
        row = dict(values) | {"episodes": len(values["episodes"])}
        for interval in ("ci95", "paired_ci95"):
            low, high = values[interval] or (None, None)
            row |= {f"{interval}_low": low, f"{interval}_high": high}
        lines.append([row[column] for column in _COLUMNS])
    return csv_text(_COLUMNS, lines)
