"""The document, table and advice of a plan within a number of QPU seconds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from qcompile.caller import option
from qcompile.notebook import reward_text
from qcompile.planning.point import Point
from qcompile.planning.search import SearchResult
from qcompile.report.table import Cell, Column, Table
from qcompile.report.tables import plural

Command = Callable[[Point], str | None]


def within_values(result: SearchResult, command: Command) -> dict[str, Any]:
    """The part of `plan --json` for a limit of seconds; `command` gives the command of a point."""
    goal, chosen = result.goal, result.recommended
    baseline = result.points[0].baseline
    return {
        "within": goal.within,
        "keep": goal.keep,
        "scored_episodes": goal.trial_episodes,
        "random_reward": float(baseline.random.mean()),
        "ideal_reward": float(baseline.ideal.mean()),
        "frontier": [point.values for point in result.frontier],
        "recommended": None if chosen is None else chosen.values | {"command": command(chosen)},
        "nearest": None if chosen is not None else result.nearest(),
    }


def frontier_table(values: Mapping[str, Any]) -> Table:
    """The best settings, with a star at the recommended ones."""
    points, chosen = values["frontier"], values["recommended"] or {}
    several = len({(point["policy"], point["hold"]) for point in points}) > 1
    is_cut = any(point["max_steps"] for point in points)
    names = ["ahead"] + ["max steps"] * is_cut + ["jobs", "QPU seconds"]
    ends = ("80 % interval, low", "80 % interval, high")
    columns = [
        *[Column("policy", right=False)] * several,
        Column("shots", parts=("shots", "recommended")),
        Column("copies", parts=("copies", "split")),
        *map(Column, names),
        Column("80 % interval", parts=ends),
        *map(Column, ("at 4 sub-jobs", "mean reward", "kept")),
    ]
    rows: list[list[Cell | str]] = []
    for point in points:
        star = "*" if point.items() <= chosen.items() else None
        split = "split" if point["split"] else None
        low, high = point["qpu_seconds_80"]
        rows.append(
            [point["policy"]] * several
            + [
                Cell(" ".join(filter(None, [str(point["shots"]), star])), (point["shots"], star)),
                Cell(
                    ", ".join(filter(None, [str(point["copies"]), split])),
                    (point["copies"], split),
                ),
                Cell.of(point["speculate"]),
            ]
            + [Cell.of(point["max_steps"])] * is_cut
            + [
                Cell.of(point["jobs"]),
                _cell(point, "qpu_seconds", ",.1f"),
                Cell(f"{low:,.0f} to {high:,.0f}", (low, high)),
                _cell(point, "qpu_seconds_at_4_sub_jobs", ",.0f"),
                Cell(reward_text(point["mean_reward"]), (point["mean_reward"],)),
                Cell(f"{100 * point['share']:.1f} %", (point["share"],)),
            ]
        )
    return Table(columns, rows)


def _cell(point: Mapping[str, Any], key: str, form: str) -> Cell:
    return Cell(format(point[key], form), (point[key],))


def advice(values: Mapping[str, Any]) -> str:
    """The recommended command, or a message that nothing fits, and what would."""
    chosen, within, keep = values["recommended"], values["within"], values["keep"]
    if chosen is not None:
        low, high = chosen["qpu_seconds_80"]
        words = (
            f"* recommended: {chosen['qpu_seconds']:.1f} QPU seconds on average, {low:.0f} to "
            f"{high:.0f} in four of five runs"
        )
        return "\n".join(filter(None, [words, chosen["command"]]))
    nearest = values["nearest"]
    fits = [
        plural(nearest["episodes"], "episode") if nearest["episodes"] else "",
        f"{nearest['within']:,.0f} QPU seconds" if nearest["within"] else "",
        f"{option('keep')} {nearest['keep']:g}" if (nearest["keep"] or 0) > 0 else "",
    ]
    limit = f"No settings keep {100 * keep:g} % of the reward within {within:,g} QPU seconds."
    changes = " or ".join(filter(None, fits))
    return f"{limit} It would fit with {changes}." if changes else limit
