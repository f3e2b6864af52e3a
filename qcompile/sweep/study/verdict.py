"""Whether what is claimed of a row holds here, if what was trained can tell."""

from __future__ import annotations

from dataclasses import replace

from qcompile.sweep.study.summary import RowSummary

HOLDS = 1.2
"""A claim holds where ours takes at most so many times its episodes."""


def verdict(summary: RowSummary) -> str:
    """The verdict on the claimed number of episodes, in words; - where there is none.

    A claim of the best seed is judged by the row's own seeds: with more of them one is better.
    """
    row = summary.row
    wanted = row.claim.episodes
    if wanted is None:
        return "-"
    best_counts = row.claim.seed == "best"
    own = tuple(result for result in summary.results if result.seed in row.seeds)
    first, trained = summary.mean_first, len(summary.mean_curve)
    if best_counts and own:
        judged = replace(summary, results=own)
        first = min((f for f in judged.each_first if f is not None), default=None)
        trained = len(judged.mean_curve)
    holds = first is not None and first <= HOLDS * wanted
    if len(own) < len(row.seeds) and not (best_counts and own and holds):
        return f"not tested: {len(own)} of {len(row.seeds)} seeds"
    if not holds and trained < int(HOLDS * wanted):
        return f"not tested: {trained:,} of {int(HOLDS * wanted):,} episodes"
    if first is None:
        return "does not hold: not reached"
    of = "the best seed takes " if best_counts else ""
    return f"{'holds' if holds else 'does not hold'}: {of}{first / wanted:.2f} times the episodes"
