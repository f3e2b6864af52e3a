"""Whether the published result for a row holds here, if enough was trained to tell."""

from __future__ import annotations

from dataclasses import replace

from qcompile.sweep.study.summary import RowSummary

HOLDS = 1.2
"""A claim holds if we need at most this many times its episodes."""


def verdict(summary: RowSummary) -> str:
    """The verdict on the claimed number of episodes; "-" if there is none.

    A claim about the best seed is tested only with the seeds of the row: the best of more seeds
    would be better.
    """
    row = summary.row
    claimed = row.claim.episodes
    if claimed is None:
        return "-"
    best_counts = row.claim.seed == "best"
    of_row = tuple(result for result in summary.results if result.seed in row.seeds)
    first, trained = summary.mean_first, len(summary.mean_curve)
    if best_counts and of_row:
        tested = replace(summary, results=of_row)
        first = min((f for f in tested.each_first if f is not None), default=None)
        trained = len(tested.mean_curve)
    holds = first is not None and first <= HOLDS * claimed
    if len(of_row) < len(row.seeds) and not (best_counts and of_row and holds):
        return f"not tested: {len(of_row)} of {len(row.seeds)} seeds"
    if not holds and trained < int(HOLDS * claimed):
        return f"not tested: {trained:,} of {int(HOLDS * claimed):,} episodes"
    if first is None:
        return "does not hold: not reached"
    who = "the best seed needs " if best_counts else ""
    return f"{'holds' if holds else 'does not hold'}: {who}{first / claimed:.2f} times the episodes"
