"""The study written up: tables and figures as a page of the documentation."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.rl.order import AVERAGED
from qcompile.sweep.pages import markdown_table, version_words
from qcompile.sweep.study.paper import belongs, figures
from qcompile.sweep.study.summary import TOO_FEW, RowSummary, spread

_HOLDS = 1.2
"""A claim of the paper holds where ours takes at most so many times its episodes."""

_HEAD = """\
# The paper's training study, reproduced

Written by `qcompile study paper` from the trainings in {folder}; nothing on this page is typed by
hand. Every row is trained with several seeds, its settings come from the preset named (`paper` is
arXiv 2203.14348 as it stands, `tuned` is ours; docs/training.md says what they are), and the
final model plays {evaluation} fresh episodes, actions sampled, that no training saw.

How to read the tables:

- **parameters**: the numbers that are trained in the policy as built, copies of output reuse
  folded. The critic, which is not deployed, is not counted: it has as many again, less what its
  single output spares, or is a network where docs/training.md says so.
- **paper**: what the paper says, in episodes, where nothing else is said.
- **mean of seeds at target**: the first episode after which the average of the last 20 rewards,
  averaged over all seeds, is at the target. **seeds at target**: how many seeds reach it by
  themselves, and the episodes they take: the median, and the range of those that do.
- **best, last average**: of the last 20 rewards: the best one of each seed, and the one at the end
  of its training, mean ± standard deviation over the seeds. Episodes of environments that step
  together count in the order in which they began: in the order in which they end, short ones come
  first. The best of many averages is above what any model scores: for that read the next column.
- **fresh episodes**: the mean reward of the final model, mean ± standard deviation over the seeds,
  and the lowest seed.
- **the paper's number**: "holds" where the mean of the seeds is at the target within {holds:g}
  times the paper's episodes (LunarLander: the best seed, as in the paper); "not tested" where fewer
  episodes or seeds were trained than it takes to tell.
"""

_COLUMNS = (
    "model",
    "preset",
    "parameters",
    "paper",
    "mean of seeds at target",
    "seeds at target",
    "best average",
    "last average",
    "fresh episodes",
    "the paper's number",
)


def page(summaries: Sequence[RowSummary], folder: str, versions: dict[str, str]) -> str:
    """The page, in Markdown; figures and CSV are linked in `folder`, as seen from the page."""
    evaluation = max(len(result.evaluation) for s in summaries for result in s.results)
    linked = f"[{folder}]({folder}/results.csv)" if folder != "." else "[this folder](results.csv)"
    parts = [_HEAD.format(folder=linked, evaluation=evaluation, holds=_HOLDS)]
    for name, figure in figures().items():
        members = [s for s in summaries if belongs(s.row, name)]
        if not members:
            continue
        parts.append(f"## {figure.title}\n")
        target = members[0].row.target
        parts.append(f"Target: an average of {target:g}{_other_targets(members)}.\n")
        parts.append(f"![Learning curves, {figure.title}]({folder}/{name}.png)\n")
        parts.append(markdown_table(_COLUMNS, [*map(_cells, members)]))
    parts.append(
        "## Repeat it\n\n```\nqcompile study paper --out study\nqcompile study paper --figure "
        "acrobot --out study\n```\n\nA study resumes where it was stopped: what is in its folder "
        f"is not trained again. Made with {version_words(versions)}; the same versions on the same "
        "machine give the same numbers, whatever the engine and the number of workers. The curves "
        f"of all figures are in [curves.csv]({folder}/curves.csv).\n"
    )
    return "\n".join(parts)


def _other_targets(members: Sequence[RowSummary]) -> str:
    others = [s for s in members if s.row.target != members[0].row.target]
    return "".join(f" ({s.row.target:g} for {s.row.title}, {s.row.preset})" for s in others)


def _cells(summary: RowSummary) -> tuple[str, ...]:
    row, evaluation = summary.row, summary.evaluation
    return (
        row.title,
        f"`{row.preset}`",
        f"{summary.parameters:,}",
        row.claim.words,
        _episode(summary),
        _seeds(summary),
        spread(summary.best),
        spread(summary.final),
        f"{spread(evaluation)}, lowest {evaluation.min():.1f}",
        verdict(summary),
    )


def _episode(summary: RowSummary) -> str:
    if len(summary.mean_curve) < AVERAGED:
        return TOO_FEW
    first = summary.mean_first
    return "not reached" if first is None else f"{first:,}"


def _seeds(summary: RowSummary) -> str:
    each = summary.each_first
    reached = [first for first in each if first is not None]
    words = f"{len(reached)} of {len(each)}"
    if not reached:
        return words
    median = summary.median_first
    middle = "" if median is None else f"{median:,.0f}, "
    return f"{words}: {middle}{min(reached):,} to {max(reached):,}"


def verdict(summary: RowSummary) -> str:
    """Whether the paper's number of episodes holds here, if what was trained can tell."""
    row, results = summary.row, summary.results
    wanted = row.claim.episodes
    if wanted is None:
        return "-"
    best_counts = row.figure == "lunarlander"
    first, trained = summary.mean_first, len(summary.mean_curve)
    if best_counts:
        first = min((f for f in summary.each_first if f is not None), default=None)
        trained = min(len(result.averages) for result in results)
    holds = first is not None and first <= _HOLDS * wanted
    if len(results) < row.seeds and not (best_counts and holds):
        return f"not tested: {len(results)} of {row.seeds} seeds"
    if first is None and trained < int(_HOLDS * wanted):
        return f"not tested: {trained:,} of {int(_HOLDS * wanted):,} episodes"
    if first is None:
        return "does not hold: not reached"
    ratio = first / wanted
    return f"{'holds' if holds else 'does not hold'}: {ratio:.2f} times the episodes"
