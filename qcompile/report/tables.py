"""Tables on the terminal, and the words that several of them share."""

from __future__ import annotations

import json
import os
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any, Literal

from rich import box
from rich.cells import cell_len
from rich.markup import escape
from rich.table import Table as RichTable

from qcompile.mitigation.misfit import misfit_warnings
from qcompile.notebook import reward_form, reward_text
from qcompile.policy.decision import hold_text
from qcompile.report.console import PlainConsole, console
from qcompile.report.table import INTERVAL_NAME, Cell, Column, Table

_LEAST_FOR_INTERVAL = 5
_LEAST_TEXT = 12
"""Letters of a name that stay together."""
_UNBOUNDED = PlainConsole(width=100_000)
_NOTHING = 1e-9
"""A difference of less than this share of the rewards is rounding."""


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    title: str = "",
    *,
    tight: bool = False,
    right: Container[int] = (),
) -> None:
    """Print a table on standard output; columns of numbers, and those of `right`, on the right.

    A `tight` one has less room between its columns. Where a terminal is too narrow, headers break
    between their words and long names anywhere, but numbers never: the lines are longer then.
    """
    rows = [list(row) for row in rows]
    cells = [[_cell(value) for value in row] for row in rows]
    table = RichTable(
        title=escape(title) or None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        collapse_padding=tight,
        pad_edge=not tight,
    )
    for index, column in enumerate(columns):
        numeric = bool(rows) and all(isinstance(row[index], int | float) for row in rows)
        justify: Literal["right", "left"] = "right" if numeric or index in right else "left"
        table.add_column(escape(column), justify=justify, overflow="fold")
    for row in cells:
        table.add_row(*map(escape, row))
    out = wide_console()
    room = out.width - _UNBOUNDED.measure(table).maximum
    widths = _widths(columns, list(zip(*cells, strict=True)) or [()] * len(columns), room)
    for narrowed, width in zip(table.columns, widths, strict=True):
        narrowed.width = width
    out.width = max(out.width, _UNBOUNDED.measure(table).maximum)
    out.print(table)


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def wide_console() -> PlainConsole:
    """Standard output; as wide as a line gets where no terminal, nor COLUMNS, says how wide."""
    out = console(highlight=False)
    if not out.is_terminal and not os.environ.get("COLUMNS", "").isdecimal():
        out.width = _UNBOUNDED.width
    return out


def _widths(columns: Sequence[str], cells: Sequence[Sequence[str]], room: int) -> list[int]:
    """The width of each column; the widest give way, one by one, where `room` is negative."""
    widths, least = [], []
    for header, column in zip(columns, cells, strict=True):
        lines = [line for cell in column for line in cell.split("\n")]
        inside = max(map(cell_len, lines), default=0)
        is_text = any(cell[:1].isalpha() and cell_len(cell) > _LEAST_TEXT for cell in column)
        word = max(map(cell_len, header.split()), default=0)
        widths.append(max(cell_len(header), inside))
        least.append(max(word, _LEAST_TEXT if is_text else inside))
    while room < 0:
        slack = [index for index, width in enumerate(widths) if width > least[index]]
        if not slack:
            break
        widths[max(slack, key=widths.__getitem__)] -= 1
        room += 1
    return widths


def print_hold(hold: int) -> None:
    """Print how long each decision is held, where that is more than a step."""
    if hold > 1:
        wide_console().print(f"each decision is {hold_text(hold)}")


def print_grid(objects: Sequence[Mapping[str, Any]]) -> None:
    """Print the results of `qcompile evaluate --json`, a table for each policy."""
    extra = _extra_columns(objects)
    for policy in dict.fromkeys(values["policy"] for values in objects):
        results = [values for values in objects if values["policy"] == policy]
        played = plural(len(results[0]["episodes"]), "episode")
        title = f"{policy} in {environment_words(results[0])}, {played}"
        if "level" not in extra and results[0]["circuits_per_step"]:
            title += f", level {results[0]['level']}"
        title += ", greedy" * results[0]["greedy"]
        if (hold := results[0].get("hold", 1)) > 1:
            title += f", each decision {hold_text(hold)}"
        rows = [_grid_row(values, extra) for values in results]
        print_table(_grid_columns(extra), rows, title, tight=True)
        for words in grid_warnings(results):
            wide_console().print(escape(words))


def grid_warnings(objects: Sequence[Mapping[str, Any]]) -> list[str]:
    """What a reader of the results must know first."""
    return [
        f"{values['backend']}: {words}"
        for values in objects
        for words in misfit_warnings(values.get("calibration_misfits", []))
    ]


def environment_words(values: Mapping[str, Any]) -> str:
    """The environment of a result, with its arguments in JSON."""
    if not (arguments := values.get("environment_kwargs")):
        return str(values["environment"])
    words = ", ".join(f"{name}={json.dumps(value)}" for name, value in arguments.items())
    return f"{values['environment']} ({words})"


def grid_table(objects: Sequence[Mapping[str, Any]], notes: Sequence[str] = ()) -> Table:
    """The same in one table for all policies."""
    extra = _extra_columns(objects)
    environments = list(dict.fromkeys(map(environment_words, objects)))
    named = len(environments) > 1 or any(v.get("environment_kwargs") for v in objects)
    holds = any(values.get("hold", 1) > 1 for values in objects)
    columns = [
        Column("policy", right=False, setting=True),
        *[Column("environment", right=False, setting=True)] * named,
        *[Column("hold", setting=True)] * holds,
        Column("backend", right=False, setting=True),
        Column("shots", setting=True),
        Column("mitigation", right=False, setting=True),
        *[Column(name, setting=True) for name in extra],
        *(SCORE, INTERVAL),
        Column("to ideal", parts=("to ideal",)),
        Column("solved", right=False),
    ]
    rows = []
    for values in objects:
        settings, scores = _grid_row(values, extra)[:-4], _grid_row(values, extra)[-4:]
        difference = None if values["reference"] else values["paired_difference"]
        cells = [
            score_cell(values["mean_reward"], values["std_reward"]),
            interval_cell(values),
            Cell(str(scores[2]), (difference,)),
            Cell.of({True: "yes", False: "no", None: None}[values["solved"]]),
        ]
        first = [values["policy"], *[environment_words(values)] * named]
        first += [str(values.get("hold", 1))] * holds
        by = values["backend"] if values["reference"] else ""
        backend, *others = map(str, settings)
        chosen = [Cell(word, (word,), by) for word in others]
        rows.append([*first, backend, *chosen, *cells])
    if not objects:
        return Table(columns, rows)
    played = plural(len(objects[0]["episodes"]), "episode")
    greedy = ", greedy" * objects[0]["greedy"]
    return Table(columns, rows, f"{' and '.join(environments)}, {played}{greedy}", notes)


SCORE = Column("mean ± std", parts=("mean reward", "standard deviation"))
INTERVAL = Column(INTERVAL_NAME, parts=(f"{INTERVAL_NAME}, low", f"{INTERVAL_NAME}, high"))
_UNCUT = Column(
    "its 95 % interval", parts=("95 % interval uncut, low", "95 % interval uncut, high")
)


def run_table(summary: Mapping[str, Any], requested: int, notes: Sequence[str] = ()) -> Table:
    """A row for a run of `requested` episodes, with columns for what was cut or left out."""
    finished = len(summary["episodes"])
    row: dict[Column, Cell | str] = {
        Column("policy", right=False): summary["policy"],
        Column("backend", right=False): summary["backend"],
        Column("kind", right=False): summary["kind"],
        Column("shots"): Cell.of(summary["shots"]),
        Column("mitigation", right=False): (
            "predistort" if summary["predistort"] else summary["mitigation"]
        ),
    }
    if summary["hold"] > 1:
        row[Column("hold")] = Cell.of(summary["hold"])
    if summary["interrupted"]:
        asked = Column("episodes", parts=("episodes", "episodes asked for"))
        row[asked] = Cell(f"{finished} of {requested}", (finished, requested))
    else:
        row[Column("episodes")] = Cell.of(finished)
    row[Column("mean reward")] = reward_cell(summary["mean_reward"])
    row[INTERVAL] = interval_cell(summary)
    if summary["cut_episodes"]:
        row[Column("cut")] = Cell.of(summary["cut_episodes"])
        row[Column("mean uncut")] = reward_cell(summary["mean_reward_completed"])
        row[_UNCUT] = interval_cell(summary, "ci95_completed")
    return Table([*row], [[*row.values()]], notes=notes)


def score_cell(mean: float | None, deviation: float | None = None) -> Cell:
    """The mean of rewards, and their standard deviation, for a column such as SCORE."""
    return Cell("-" if mean is None else reward_text(mean, deviation), (mean, deviation))


def reward_cell(mean: float | None) -> Cell:
    """The mean of rewards alone."""
    return Cell("-" if mean is None else reward_text(mean), (mean,))


def interval_cell(summary: Mapping[str, Any], key: str = "ci95") -> Cell:
    """The interval of `interval_words`, for the column INTERVAL."""
    low, high = summary.get(key) or (None, None)
    words = interval_words(summary, key)
    return Cell(words, (low, high)) if words else Cell("-", (None, None))


def _extra_columns(objects: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Columns that only some grids need, and the keys of their values."""
    extra = {}
    if len({values["level"] for values in objects}) > 1:
        extra["level"] = "level"
    if any(values.get("couplings_per_circuit") for values in objects):
        extra["couplings"] = "couplings_per_circuit"
    return extra


def _grid_columns(extra: Iterable[str]) -> list[str]:
    settings = ["backend", "shots", "mitigation", *extra]
    return [*settings, "mean ± std", "95 % interval", "to ideal", "solved"]


def _grid_row(values: Mapping[str, Any], extra: Mapping[str, str]) -> list[object]:
    difference = values["paired_difference"]
    return [
        values["backend"],
        str(values["shots"]),
        values["mitigation"],
        *[values[key] for key in extra.values()],
        reward_text(values["mean_reward"], values["std_reward"]),
        interval_words(values) or "-",
        "-"
        if values["reference"] or difference is None
        else difference_text(difference, values["mean_reward"]),
        {True: "yes", False: "no", None: "-"}[values["solved"]],
    ]


def difference_text(difference: float, mean: float) -> str:
    """A difference of mean rewards, as rewards of that size are shown."""
    is_rounding = abs(difference) < _NOTHING * abs(mean)
    return reward_text(0.0 if is_rounding else difference, sign="+")


def interval_words(summary: Mapping[str, Any], key: str = "ci95") -> str:
    """The 95 % interval of the mean reward; empty where too few episodes say how they scatter."""
    if summary.get(key) is None or len(summary["episodes"]) < _LEAST_FOR_INTERVAL:
        return ""
    low, high = summary[key]
    form = reward_form(low, high)
    return f"{low:{form}} to {high:{form}}"


def plural(count: int, word: str) -> str:
    """1 round, 2 rounds."""
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def cost_in_words(row: Mapping[str, Any]) -> str:
    """The charge of a run; where it is not settled, what it comes to at most, and why."""
    settled_s, upper_s = row["qpu_seconds_settled"], row["qpu_seconds"]
    words = f"{settled_s:.1f} QPU seconds charged"
    unsettled = []
    if row["jobs_uncharged"]:
        unsettled.append(f"{plural(row['jobs_uncharged'], 'job')} not charged yet")
    if row["jobs_in_doubt"]:
        unsettled.append(f"{plural(row['jobs_in_doubt'], 'job')} in doubt")
    if upper_s > settled_s:
        words += f", {upper_s:.1f} at most"
    return f"{words} ({', '.join(unsettled)})" if unsettled else words
