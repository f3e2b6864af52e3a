"""A study written up: tables and figures as a page of Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from textwrap import fill

from qcompile.notebook import reward_digits
from qcompile.rl.order import AVERAGED
from qcompile.sweep.pages import assignments, markdown_table, markdown_text, version_words
from qcompile.sweep.study.rows import Rows
from qcompile.sweep.study.summary import TOO_FEW, RowSummary, spread
from qcompile.sweep.study.trained import from_to, repeat_words, trained_words
from qcompile.sweep.study.verdict import HOLDS, verdict

_LEGEND = {
    "parameters": "the numbers that are trained in the policy as built, copies of output reuse "
    "folded. The critic, which is not deployed, is not counted: it has as many again, less what "
    "its single output spares, or is a network where the preset has `critic_hidden`.",
    "claim": "what others say of the row, in episodes where nothing else is said.",
    "mean of seeds at target": "the first episode after which the average of the last 20 rewards, "
    "averaged over all seeds, is at the target. **seeds at target**: how many seeds reach it by "
    "themselves, and the episodes they take: the median, and the range of those that do.",
    "best, last average": "of the last 20 rewards: the best one of each seed, and the one at the "
    "end of its training, mean ± standard deviation over the seeds. Episodes of environments that "
    "step together count in the order in which they began: in the order in which they end, short "
    "ones come first. The best of many averages is above what any model scores: for that read the "
    "next column.",
    "fresh episodes": "the mean reward of the final model, mean ± standard deviation over the "
    "seeds, and the lowest seed.",
    "verdict": '"holds" where the mean of the seeds, or the best seed where that is said, is at '
    f'the target within {HOLDS:g} times the claimed episodes; "not tested" where fewer episodes '
    "or seeds were trained than it takes to tell.",
}
_OF_CLAIMS = ("claim", "verdict")
_OF_TARGETS = ("mean of seeds at target", "seeds at target")
_LABEL = ("model", "preset")
_SCORES = ("best average", "last average", "fresh episodes")
_COLUMNS = (*_LABEL, "parameters", "claim", *_OF_TARGETS, *_SCORES, "verdict")


def page(
    study: Rows,
    summaries: Sequence[RowSummary],
    command: str,
    repeated: Sequence[str],
    folder: str,
    versions: dict[str, str],
) -> str:
    """The page, in Markdown; figures and CSV are linked in `folder`, as seen from the page.

    `command` is what was typed, `repeated` the names of the cells that it trains.
    """
    left_out = set() if any(s.row.claim.words != "-" for s in summaries) else {*_OF_CLAIMS}
    if all(s.row.target is None for s in summaries):
        left_out |= {*_OF_TARGETS}
    linked = (
        f"[{PurePosixPath(folder).name}]({folder}/results.csv)"
        if folder != "."
        else "[this folder](results.csv)"
    )
    seeds = from_to([len(s.results) for s in summaries], "seed")
    evaluation = from_to([len(r.evaluation) for s in summaries for r in s.results], "fresh episode")
    parts = [
        f"# {markdown_text(study.title)}\n",
        fill(
            f"Written by `qcompile study {study.name}` from the trainings in {linked}; no result "
            f"on this page is typed by hand. A row is trained with {seeds}, its settings are those "
            "of the preset named and what the study changes, and the final model plays "
            f"{evaluation}, actions sampled, that no training saw.",
            100,
            break_long_words=False,
            break_on_hyphens=False,
        )
        + "\n",
        f"{markdown_text(study.about)}\n" if study.about else "",
        trained_words(study, summaries),
        "How to read the tables:\n",
        "".join(
            fill(f"- **{name}**: {words}", 100, subsequent_indent="  ", break_on_hyphens=False)
            + "\n"
            for name, words in _LEGEND.items()
            if name not in left_out
        ),
    ]
    heads = _heads([column for column in _COLUMNS if column not in left_out])
    for name, figure in study.figures.items():
        members = [s for s in summaries if study.belongs(s.row, name)]
        if not members:
            continue
        title = markdown_text(figure.title)
        parts += [
            f"## {title}\n",
            f"Environment: {_environments(members)}.{_targets(members)}\n",
            f"![Learning curves, {title}]({folder}/{name}.png)\n",
            *(
                markdown_table(head, [[_cells(s)[column] for column in head] for s in members])
                for head in heads
            ),
        ]
    changed = [s.row for s in summaries if s.row.changes]
    if changed:
        lines = [[f"`{row.name}`", assignments(row.changes)] for row in changed]
        parts += ["## Settings\n", markdown_table(("row", "changes of its preset"), lines)]
    parts.append(
        f"## Repeat it\n\n```\n{command}\n```\n\n{repeat_words(summaries, repeated)}"
        "A study resumes where it was stopped: what is in its folder is not trained again. Made "
        f"with {version_words(versions)}; the same versions on the same machine give the same "
        "numbers, whatever the engine and the number of workers. The curves of all figures are in "
        f"[curves.csv]({folder}/curves.csv).\n"
    )
    return "\n".join(part for part in parts if part)


def _heads(columns: Sequence[str]) -> list[list[str]]:
    """The heads of a figure's tables: with targets two, as one would be wider than a screen."""
    if not {*_OF_TARGETS} & {*columns}:
        return [[*columns]]
    return [[column for column in columns if column not in _SCORES], [*_LABEL, *_SCORES]]


def _environments(members: Sequence[RowSummary]) -> str:
    """The environments, with the arguments that they are made with."""
    words = {
        f"`{s.row.environment}`"
        + (f" with {assignments(s.row.arguments)}" if s.row.arguments else "")
        for s in members
    }
    return " and ".join(sorted(words))


def _targets(members: Sequence[RowSummary]) -> str:
    """The target of the first row that has one, and those of rows that have another."""
    targets = [s.row.target for s in members if s.row.target is not None]
    if not targets:
        return ""
    others = [
        f" ({'none' if s.row.target is None else f'{s.row.target:g}'} for {_label(s)})"
        for s in members
        if s.row.target != targets[0]
    ]
    return f" Target: an average of {targets[0]:g}{''.join(others)}."


def _label(summary: RowSummary) -> str:
    return markdown_text(f"{summary.row.title}, {summary.row.preset}")


def _cells(summary: RowSummary) -> dict[str, str]:
    """The line of a row, by column."""
    row, evaluation = summary.row, summary.evaluation
    lowest = f"{evaluation.min():.{reward_digits(evaluation.mean())}f}"
    cells = (
        markdown_text(row.title),
        f"`{row.preset}`",
        f"{summary.parameters:,}",
        markdown_text(row.claim.words),
        _episode(summary),
        _seeds(summary),
        spread(summary.best),
        spread(summary.final),
        f"{spread(evaluation)}, lowest {lowest}",
        verdict(summary),
    )
    return dict(zip(_COLUMNS, cells, strict=True))


def _episode(summary: RowSummary) -> str:
    if summary.row.target is None:
        return "-"
    if len(summary.mean_curve) < AVERAGED:
        return TOO_FEW
    first = summary.mean_first
    return "not reached" if first is None else f"{first:,}"


def _seeds(summary: RowSummary) -> str:
    if summary.row.target is None:
        return "-"
    each = summary.each_first
    reached = [first for first in each if first is not None]
    words = f"{len(reached)} of {len(each)}"
    if not reached:
        return words
    median = summary.median_first
    middle = "" if median is None else f"{median:,.0f}, "
    return f"{words}: {middle}{min(reached):,} to {max(reached):,}"
