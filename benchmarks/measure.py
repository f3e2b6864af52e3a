"""Measuring and printing for benchmarks: alternating pairs, medians of ratios, quartiles.

qcompile and the peer are measured alternately, and a ratio is the median over pairs, with
quartiles: machines drift, pairs do not. Seconds are medians too, for orientation.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from qcompile.report.tables import print_table


@dataclass(frozen=True)
class Row:
    """A figure with its quartiles, its description and its target."""

    what: str
    qcompile_s: float | None
    peer_s: float | None
    figure: float
    quartiles: tuple[float, float]
    unit: str
    wanted: str


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def in_turn(
    ours: Callable[[], object], theirs: Callable[[], object], pairs: int
) -> list[tuple[float, float]]:
    """The seconds of both, measured alternately after one warm-up of ours."""
    ours()
    return [(seconds(ours), seconds(theirs)) for _ in range(pairs)]


def compared(
    what: str,
    pairs: list[tuple[float, float]],
    wanted: str,
    *,
    work: float = 1.0,
    slower: bool = False,
) -> Row:
    """A row of measured pairs; `work` is our amount of work relative to the peer's.

    The figure is the factor by which qcompile is faster, or with `slower` the ratio of times.
    """
    ratios = [ours / theirs if slower else theirs / ours * work for ours, theirs in pairs]
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    ours, theirs = np.median(pairs, axis=0)
    unit = "times the time" if slower else "times faster"
    return Row(
        what, float(ours), float(theirs), float(middle), (float(low), float(high)), unit, wanted
    )


def alone(what: str, times: list[float], factor: float, unit: str, wanted: str) -> Row:
    """A row without a peer; the figure is the median in `unit`, seconds times `factor`."""
    low, middle, high = np.percentile(times, [25, 50, 75]).tolist()
    return Row(what, middle, None, middle * factor, (low * factor, high * factor), unit, wanted)


def spread(what: str, figures: list[float], unit: str, wanted: str) -> Row:
    """A row of figures other than times, one per seed."""
    low, middle, high = np.percentile(figures, [25, 50, 75]).tolist()
    return Row(what, None, None, middle, (low, high), unit, wanted)


def show(rows: Callable[[], list[Row]], description: str) -> None:
    """Measure and print a table, or with --json one JSON document."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    as_json = parser.parse_args().json
    measured = rows()
    if as_json:
        print(json.dumps([asdict(row) for row in measured], indent=1))  # noqa: T201
        return
    print_table(
        ["what; the peer", "qcompile, s", "peer, s", "figure", "wanted"],
        [
            [
                row.what,
                "" if row.qcompile_s is None else f"{row.qcompile_s:.3g}",
                "" if row.peer_s is None else f"{row.peer_s:.3g}",
                f"{row.figure:.4g} {row.unit} ({row.quartiles[0]:.4g} to {row.quartiles[1]:.4g})",
                row.wanted,
            ]
            for row in measured
        ],
    )
