"""Write up a study: tables and figures as a Markdown page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from textwrap import fill

from qcompile.notebook import reward_form
from qcompile.rl.order import AVERAGED
from qcompile.sweep.pages import assignments, markdown_table, markdown_text, version_words
from qcompile.sweep.study.rows import Rows
from qcompile.sweep.study.summary import TOO_FEW, RowSummary, spread
from qcompile.sweep.study.trained import from_to, repeat_words, trained_words
from qcompile.sweep.study.verdict import HOLDS, verdict

_LEGEND = {
    "parameters": "trained parameters of the policy, with the copies of output reuse merged. The "
    "critic is not counted, because it is only used in training.",
    "claim": "the published result, in episodes unless another unit is given.",
    "mean of seeds at target": "the first episode at which the mean over all seeds of the average "
    "of the last 20 rewards reaches the target. **seeds at target**: the number of seeds whose own "
    "average reaches it, and the episodes that these need: median and range.",
    "best, last average": "best and final average of the last 20 rewards in training, mean ± "
    "standard deviation over the seeds. Episodes are in the order in which they began. The best of "
    "many averages is too high an estimate of a model's score; the next column is a fair one.",
    "fresh episodes": "mean reward of the trained model in new episodes, mean ± standard deviation "
    "over the seeds, and the lowest seed.",
    "verdict": '"holds" if the mean of the seeds, or the best seed if the claim is about that one, '
    f'reaches the target within {HOLDS:g} times the claimed episodes; "not tested" if too few '
    "episodes or seeds were trained to tell.",
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
    """The page, in Markdown, with links to figures and CSV in `folder`, relative to the page.

    `command` is the command line, `repeated` are the names of the cells that it trains.
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
            f"This page is written by `qcompile study {study.name}` from the trainings in "
            f"{linked}; no number on it is typed by hand. Each row is trained with {seeds}. Its "
            "settings are "
            "those of its preset, with the changes that the study makes. At the end, each trained "
            f"model plays {evaluation}, with sampled actions.",
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
        "Trainings that are already in the folder are not repeated. Made with "
        f"{version_words(versions)}; the same versions on the same machine give the same numbers, "
        "with any engine and any number of workers. The curves of all figures are in "
        f"[curves.csv]({folder}/curves.csv).\n"
    )
    return "\n".join(part for part in parts if part)


def _heads(columns: Sequence[str]) -> list[list[str]]:
    """The heads of a figure's tables: with targets two, as one would be wider than a screen."""
    if not {*_OF_TARGETS} & {*columns}:
        return [[*columns]]
    return [[column for column in columns if column not in _SCORES], [*_LABEL, *_SCORES]]


def _environments(members: Sequence[RowSummary]) -> str:
    """The environments, with their arguments."""
    words = {
        f"`{s.row.environment}`"
        + (f" with {assignments(s.row.arguments)}" if s.row.arguments else "")
        for s in members
    }
    return " and ".join(sorted(words))


def _targets(members: Sequence[RowSummary]) -> str:
    """The target of the first row that has one, and the different targets of other rows."""
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
    lowest = format(evaluation.min(), reward_form(evaluation.mean()))
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
