"""The files of an evaluation: results.json, results.csv, and a figure for each policy."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from qcompile.output import file_name
from qcompile.report.figure import Figure
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel
from qcompile.report.style import AnyStyle
from qcompile.report.tables import interval_words, plural
from qcompile.sweep.evaluation.summary import results_csv
from qcompile.sweep.pages import write_files

RESULTS = ("results.json", "results.csv")
"""Files of every evaluation."""


def write_results(objects: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """Write results.json and results.csv; their paths.

    Raises:
        OutputError: one of them cannot be written.
    """
    document = json.dumps({"results": list(objects)}, indent=1, allow_nan=False)
    return write_files(
        {
            folder / RESULTS[0]: f"{document}\n".encode(),
            folder / RESULTS[1]: results_csv(objects).encode(),
        }
    )


def write_figures(objects: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """Write a figure for each policy; their paths.

    Raises:
        OutputError: one of them cannot be written.
    """
    policies = dict.fromkeys(values["policy"] for values in objects)
    return write_files(
        {folder / figure_name(policy): figure(objects, [policy]).png for policy in policies}
    )


def figure_name(policy: str) -> str:
    """The file of a policy's figure."""
    return f"{file_name(policy)}.png"


def figure(
    objects: Sequence[Mapping[str, Any]], policies: Sequence[str], style: AnyStyle = None
) -> Figure:
    """The mean rewards of some policies, side by side.

    Raises:
        FigureError: the style cannot be read.
    """
    alone = len(policies) == 1
    cells = {
        policy: [values for values in objects if values["policy"] == policy] for policy in policies
    }
    first = objects[0]
    environments = {values["environment"] for own in cells.values() for values in own}
    title = f"{' and '.join(sorted(environments))}, {plural(len(first['episodes']), 'episode')}"
    drawn = [panel for name, own in cells.items() for panel in _panels(own, "" if alone else name)]
    return draw_intervals(
        f"{policies[0]} in " * alone + title + ", greedy" * first["greedy"], drawn, style
    )


def _panels(objects: Sequence[Mapping[str, Any]], title: str) -> list[Panel]:
    """The mean rewards of one policy: a panel for each level, below the title."""
    played = [values for values in objects if not values["reference"]] or list(objects)
    levels = sorted({values["level"] for values in played})
    return [
        Panel(
            ", ".join(part for part in (title, f"level {level}" * (len(levels) > 1)) if part),
            [interval(values) for values in played if values["level"] == level],
            reference_line(objects),
            objects[0]["threshold"],
            scale=objects[0]["environment"],
        )
        for level in levels
    ]


def interval(values: Mapping[str, Any]) -> Interval:
    """A cell's mean reward and its 95 % interval, for a figure; of few episodes only the mean."""
    low, high = _ends(values)
    shots = values["shots"]
    return Interval(
        column=values["backend"],
        group=mitigation_words(values["mitigation"]),
        variant="exact" if shots == "exact" else f"{shots} shots",
        mean=values["mean_reward"],
        low=low,
        high=high,
        shots=math.inf if shots == "exact" else shots,
    )


def reference_line(objects: Sequence[Mapping[str, Any]]) -> tuple[float, float, float] | None:
    """Mean and 95 % interval of the reference cell, if it was played."""
    for values in objects:
        if values["reference"]:
            return (values["mean_reward"], *_ends(values))
    return None


def _ends(values: Mapping[str, Any]) -> tuple[float, float]:
    """The interval of a cell where tables show it, else the mean at both ends."""
    low, high = values["ci95"] if interval_words(values) else (values["mean_reward"],) * 2
    return low, high


def mitigation_words(mitigation: str) -> str:
    return "no mitigation" if mitigation == "none" else f"{mitigation} mitigation"
