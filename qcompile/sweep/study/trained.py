"""Text for a study's page: which trainings are missing or shorter than in the study."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from qcompile.notebook import count
from qcompile.rl.settings import Settings
from qcompile.sweep.pages import markdown_table
from qcompile.sweep.study.rows import Row, Rows
from qcompile.sweep.study.summary import RowSummary

_COLUMNS = ("row", "seeds", "episodes of each", "the study's seeds", "the study's budget")


def from_to(numbers: Collection[int], noun: str) -> str:
    """5 seeds, or 5 to 10 seeds."""
    least, most = min(numbers), max(numbers)
    return count(most, noun) if least == most else f"{least:,} to {count(most, noun)}"


def trained_words(study: Rows, summaries: Sequence[RowSummary]) -> str:
    """Which rows have fewer seeds or episodes than the study asks for, and which are missing.

    "" if every row has all its seeds and episodes.
    """
    rows = {row.name: row for row in study.rows}
    short = [s for s in summaries if _is_short(s, rows[s.row.name])]
    missing = [name for name in rows if name not in {s.row.name for s in summaries}]
    if not short and not missing:
        return ""
    parts = ["This page shows only a part of the study.\n"]
    if short:
        parts += [
            "These rows have fewer seeds or episodes than in the study:\n",
            markdown_table(_COLUMNS, [_line(s, rows[s.row.name]) for s in short]),
        ]
    if missing:
        names = ", ".join(f"`{name}`" for name in missing)
        parts.append(
            f"These rows are missing, because they were not trained, or with other settings: "
            f"{names}.\n"
        )
    return "\n".join(parts)


def repeat_words(summaries: Sequence[RowSummary], repeated: Collection[str]) -> str:
    """Which trainings on the page are not repeated by a command that trains `repeated`."""
    others = {
        s.row.name: [seed for seed in s.seeds if f"{s.row.name}-seed{seed}" not in repeated]
        for s in summaries
    }
    rows = [
        f"`{name}` (seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))})"
        for name, seeds in others.items()
        if seeds
    ]
    if not rows:
        return ""
    return f"This command does not repeat the other trainings in the folder: {', '.join(rows)}. "


def _is_short(summary: RowSummary, row: Row) -> bool:
    return not {*row.seeds} <= {*summary.seeds} or summary.row.settings != row.settings


def _line(summary: RowSummary, row: Row) -> list[str]:
    episodes = from_to([len(result.rewards) for result in summary.results], "episode")
    seeds = count(len(summary.seeds), "seed")
    return [f"`{row.name}`", seeds, episodes, count(len(row.seeds), "seed"), _budget(row.settings)]


def _budget(settings: Settings) -> str:
    budgets = {"episode": settings.episodes, "step": settings.steps}
    return " or ".join(count(most, noun) for noun, most in budgets.items() if most is not None)
