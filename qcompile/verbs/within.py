"""What a plan within a number of seconds tells: its document, its table and its words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from qcompile.notebook import reward_text
from qcompile.planning.point import Point
from qcompile.planning.search import SearchResult
from qcompile.report.tables import plural

Command = Callable[[Point], str | None]


def within_values(found: SearchResult, command: Command) -> dict[str, Any]:
    """What `plan --json` adds with a limit of seconds; `command` says how a point is played."""
    goal, chosen = found.goal, found.recommended
    baseline = found.points[0].baseline
    return {
        "within": goal.within,
        "keep": goal.keep,
        "judged_episodes": goal.trial_episodes,
        "random_reward": float(baseline.random.mean()),
        "ideal_reward": float(baseline.ideal.mean()),
        "frontier": [point.values for point in found.frontier],
        "recommended": None if chosen is None else chosen.values | {"command": command(chosen)},
        "nearest": None if chosen is not None else found.nearest(),
    }


def frontier_table(values: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of the points that are not dominated, the recommended one with a star."""
    points, chosen = values["frontier"], values["recommended"] or {}
    several = len({(point["policy"], point["hold"]) for point in points}) > 1
    is_cut = any(point["max_steps"] for point in points)
    columns = ["policy"] * several + ["shots", "copies", "ahead"] + ["cut at"] * is_cut
    columns += ["jobs", "QPU seconds", "80 % interval", "at 4 sub-jobs", "mean reward", "kept"]
    rows = []
    for point in points:
        star = " *" if point.items() <= chosen.items() else ""
        low, high = point["qpu_seconds_80"]
        rows.append(
            [point["policy"]] * several
            + [
                f"{point['shots']}{star}",
                f"{point['copies']}, split" if point["split"] else str(point["copies"]),
                str(point["speculate"]),
            ]
            + [str(point["max_steps"] or "-")] * is_cut
            + [
                str(point["jobs"]),
                f"{point['qpu_seconds']:,.1f}",
                f"{low:,.0f} to {high:,.0f}",
                f"{point['qpu_seconds_at_4_sub_jobs']:,.0f}",
                reward_text(point["mean_reward"]),
                f"{100 * point['share']:.1f} %",
            ]
        )
    return columns, rows


def advice(values: Mapping[str, Any]) -> str:
    """What to type, or that nothing fits and what would."""
    chosen, within, keep = values["recommended"], values["within"], values["keep"]
    if chosen is not None:
        low, high = chosen["qpu_seconds_80"]
        words = (
            f"* {chosen['qpu_seconds']:.1f} QPU seconds on average, {low:.0f} to {high:.0f} "
            "in four of five runs"
        )
        return "\n".join(filter(None, [words, chosen["command"]]))
    nearest = values["nearest"]
    fits = [
        plural(nearest["episodes"], "episode") if nearest["episodes"] else "",
        f"{nearest['within']:,.0f} seconds" if nearest["within"] else "",
        f"keep {nearest['keep']:g}" if (nearest["keep"] or 0) > 0 else "",
    ]
    limit = f"Nothing keeps {100 * keep:g} % within {within:,g} QPU seconds."
    would = " or ".join(filter(None, fits))
    return f"{limit} What would fit: {would}." if would else limit
