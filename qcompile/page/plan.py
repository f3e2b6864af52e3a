"""The report of a plan."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from qcompile.limits import SECONDS_PER_EXECUTION, SECONDS_PER_JOB
from qcompile.notebook import reward_text
from qcompile.page.circuits import Compiled, circuits_section
from qcompile.page.document import Block, Code, Document, Facts, Picture, Score, Section, Table
from qcompile.page.placement import placement_section
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.table import Table as Rows
from qcompile.report.tables import plural


def plan_document(
    values: Mapping[str, Any],
    table: Rows,
    draw: Callable[[AnyStyle], Figure],
    compiled: Compiled | None = None,
    *,
    remark: str = "",
    recommended: str | None = None,
    command: str = "",
) -> Document:
    """The report of a plan: `values` are the document of `qcompile plan --json`.

    `table` and `remark` are those of the plan: the ways to run it, or the frontier and what is
    recommended; `recommended` is the command that plays it, as a page shows it.
    """
    is_within = "frontier" in values
    played = [] if compiled is None else [compiled]
    episodes = plural(values["episodes"], "episode")
    limit = f" within {values['within']:g} QPU seconds" if is_within else ""
    return Document(
        "plan",
        f"{values['policy']} on {values['backend']}: the cost of {episodes}",
        f"{episodes}{limit}, forecast on a model of the machine before anything is sent.",
        _within_score(values) if is_within else _score(values),
        [*(_within_headline(values) if is_within else _headline(values))],
        [
            Section("Recommended", [*_recommended(recommended)]),
            Section("Frontier" if is_within else "Ways to run it", [*_figure(values, table, draw)]),
            circuits_section(played),
            placement_section(played),
            Section("Settings", [Facts([*_settings(values)])]),
        ],
        [remark] if is_within and remark and values["recommended"] is None else [],
        command=command,
    )


def _cheapest(values: Mapping[str, Any]) -> Mapping[str, Any]:
    ways: Sequence[Mapping[str, Any]] = values["strategies"]
    return min(ways, key=lambda way: float(way["qpu_seconds"]))


def _score(values: Mapping[str, Any]) -> Score:
    way = _cheapest(values)
    return Score("cheapest way", f"{way['qpu_seconds']:,.1f}", "QPU seconds", str(way["name"]))


def _headline(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    way, paper = _cheapest(values), values["strategies"][0]
    yield "price", f"{way['price_usd']:,.0f} USD"
    yield "of the free plan", f"{100 * way['share_of_free_plan']:,.0f} %"
    yield str(paper["name"]), f"{paper['qpu_seconds']:,.1f} QPU seconds"
    yield "jobs of the cheapest way", f"{way['jobs']:,}"
    yield "decisions", f"{values['decisions']:,}"
    yield "shots per circuit", f"{values['shots']:,}"


def _within_score(values: Mapping[str, Any]) -> Score | None:
    chosen = values["recommended"]
    if chosen is None:
        return Score(
            "settings that fit", "none", interval=f"within {values['within']:g} QPU seconds"
        )
    low, high = chosen["qpu_seconds_80"]
    return Score(
        "recommended settings take",
        f"{chosen['qpu_seconds']:,.1f}",
        "QPU seconds",
        f"{low:,.0f} to {high:,.0f} in four of five runs",
    )


def _within_headline(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    chosen = values["recommended"]
    yield "limit", f"{values['within']:g} QPU seconds"
    if chosen is not None:
        yield "reward kept", f"{100 * chosen['share']:.1f} %"
        yield "mean reward", reward_text(chosen["mean_reward"])
        yield "shots per circuit", f"{chosen['shots']:,}"
        yield "jobs", f"{chosen['jobs']:,}"
    paper = values["paper"]
    yield "as in the paper", f"{paper['qpu_seconds']:,.0f} QPU seconds"


def _recommended(command: str | None) -> Iterator[Block]:
    if command is not None:
        yield Code("Command that plays it", command, wraps=True)


def _figure(
    values: Mapping[str, Any], table: Rows, draw: Callable[[AnyStyle], Figure]
) -> Iterator[Block]:
    columns, rows = table.header, table.words
    if "frontier" not in values:
        label = "QPU seconds of each way"
        ways = values["strategies"]
        marked = frozenset({ways.index(_cheapest(values))})
        note = (
            f"Seconds are IBM's published estimate: {SECONDS_PER_JOB:g} for a job and "
            f"{SECONDS_PER_EXECUTION:g} for an execution; the free plan has "
            f"{values['free_seconds']:g} in 28 days."
        )
        yield Picture.of(label, draw, "One bar per way, on a logarithmic scale.")
        yield Table("Ways to run it", columns, rows, note, marked)
        return
    if not values["frontier"]:
        return
    yield Picture.of(
        "Reward against QPU seconds",
        draw,
        "Each point is a setting that no other beats in both reward and seconds.",
    )
    marked = frozenset(i for i, row in enumerate(rows) if any(cell.endswith(" *") for cell in row))
    note = (
        "ahead: decisions of an episode in a job, at most. at 4 sub-jobs: the seconds if IBM "
        "counts each job as four (unknown). mean reward: of "
        f"{values['scored_episodes']} whole episodes on a model of the machine, more for what is "
        "recommended. kept: its share between random actions, "
        f"{reward_text(values['random_reward'])}, and no noise, "
        f"{reward_text(values['ideal_reward'])}."
    )
    yield Table("Settings of the frontier", columns, rows, note, marked)


def _settings(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "policy", values["policy"]
    yield "backend", values["backend"]
    yield "episodes", str(values["episodes"])
    if "within" in values:
        if (chosen := values["recommended"]) is not None:
            yield from _chosen_settings(chosen)
        yield "limit", f"{values['within']:g} QPU seconds"
        yield "share of the reward to keep", f"{values['keep']:g}"
    else:
        yield "shots", f"{values['shots']:,}"
        yield "episodes side by side", str(values["copies"])
        yield "decisions", f"{values['decisions']:,}"
        yield "environment steps", f"{values['env_steps']:,}"
    yield "price", f"{values['usd_per_second']:g} USD a QPU second"


def _chosen_settings(point: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The settings that are recommended."""
    yield "shots", f"{point['shots']:,}"
    name = "copies that share the shots" if point["split"] else "episodes side by side"
    yield name, str(point["copies"])
    yield "decisions in a job", str(point["speculate"])
    yield "mitigation", point["mitigation"]
    if isinstance(point["calibration_shots"], int):  # it measures one
        yield "shots of the calibration", f"{point['calibration_shots']:,}"
    if point["max_steps"] is not None:
        yield "an episode ends after", plural(point["max_steps"], "step")
