"""The report of an evaluation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from qcompile.notebook import reward_text
from qcompile.page.circuits import Compiled, circuits_section
from qcompile.page.document import Block, Document, Facts, Heading, Picture, Score, Section, Table
from qcompile.page.placement import placement_section
from qcompile.policy.decision import hold_text
from qcompile.report.distribution import Sample, draw_distributions
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.tables import (
    difference_text,
    environment_words,
    grid_table,
    interval_words,
    plural,
)
from qcompile.validation import listed

_MOST_SAMPLES = 16
_MOST_POLICIES = 4
"""Of more policies the headline has these alone."""
_PACKAGES = ("numpy", "gymnasium", "torch", "qiskit", "qiskit-aer", "qiskit-ibm-runtime")


def evaluation_document(
    cells: Sequence[Mapping[str, Any]],
    draw: Callable[[str, AnyStyle], Figure],
    compiled: Sequence[Compiled] = (),
    *,
    warnings: Sequence[str] = (),
    command: str = "",
) -> Document:
    """The report of a grid: `cells` are the results of `qcompile evaluate --json`.

    `draw` draws the mean rewards of a policy; `compiled` is what was played.
    """
    policies = [*dict.fromkeys(cell["policy"] for cell in cells)]
    environments = [*dict.fromkeys(map(environment_words, cells))]
    backends = [*dict.fromkeys(c["backend"] for c in cells if not c["reference"])]
    on = f" on {listed(backends)}" if backends else ""
    return Document(
        "evaluate",
        f"{listed(policies)}{on}" if cells else "An evaluation without results",
        f"{plural(len(cells), 'cell')} of {listed(environments)}, "
        f"{plural(len(cells[0]['episodes']), 'episode')} each with the same resets."
        if cells
        else "No cell could be played.",
        _score(cells),
        [*_headline(cells, policies)],
        [
            Section("Results", [*_results(cells, policies, draw)]),
            Section("Episodes", [*_episodes(cells, policies)]),
            circuits_section(compiled),
            placement_section(compiled),
            Section("Settings", [*_settings(cells)]),
        ],
        warnings,
        _PACKAGES,
        command=command,
    )


def _name(cell: Mapping[str, Any]) -> str:
    """What a cell is played with."""
    if cell["reference"]:
        return f"{cell['backend']}, exact"
    shots = "exact" if cell["shots"] == "exact" else f"{cell['shots']} shots"
    mitigation = cell["mitigation"] if cell["mitigation"] != "none" else "no"
    level = f", level {cell['level']}" if cell["level"] != 2 else ""
    return f"{cell['backend']}, {shots}, {mitigation} mitigation{level}"


def _score(cells: Sequence[Mapping[str, Any]]) -> Score | None:
    """The greatest loss against the same policy without noise, in the first environment.

    A cell alone has its mean reward instead, and of cells without a reference it is the highest.
    """
    if not cells:
        return None
    place = environment_words(cells[0])  # rewards of several environments do not compare
    own = [cell for cell in cells if environment_words(cell) == place]
    where = "" if len(own) == len(cells) else f" in {place}"
    played = [cell for cell in own if not cell["reference"]] or own
    count = len(played)
    if count > 1 and not any(c["reference"] or c["paired_difference"] is None for c in played):
        cell = min(played, key=lambda cell: float(cell["paired_difference"]))
        label, which, key = "lowest difference to ideal", "the lowest", "paired_ci95"
        value = difference_text(cell["paired_difference"], cell["mean_reward"])
    else:
        cell = max(played, key=lambda cell: float(cell["mean_reward"]))
        label, which, key = "highest " * (count > 1) + "mean reward", "the highest", "ci95"
        value = reward_text(cell["mean_reward"])
    interval = interval_words(cell, key)
    several = len({other["policy"] for other in own}) > 1
    words = [
        *[f"95 % interval {interval}"] * bool(interval),
        f"{cell['policy']} on " * several + _name(cell),
        *[f"{which} of {count} cells"] * (count > 1),
    ]
    return Score(label + where, value, interval="; ".join(words))


def _headline(
    cells: Sequence[Mapping[str, Any]], policies: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """The scores of a policy; of several, the range of each, up to _MOST_POLICIES."""
    for policy in policies[:_MOST_POLICIES]:
        own = [cell for cell in cells if cell["policy"] == policy]
        if len(policies) == 1:
            yield from _scores(own)
        else:
            yield f"{policy}, mean rewards", _range_words(own)
    if len(policies) > _MOST_POLICIES:
        yield "more policies", f"{len(policies) - _MOST_POLICIES}, in the tables below"
    yield "cells", str(len(cells))


def _range_words(cells: Sequence[Mapping[str, Any]]) -> str:
    """From the lowest to the highest mean reward of a policy on its backends."""
    means = [float(cell["mean_reward"]) for cell in cells if not cell["reference"]]
    means = means or [float(cell["mean_reward"]) for cell in cells]
    ends = [reward_text(mean) for mean in (min(means), max(means))]
    return " to ".join(dict.fromkeys(ends))


def _scores(cells: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """The scores of one policy."""
    for cell in (cell for cell in cells if cell["reference"]):
        interval = interval_words(cell)
        yield "without noise", reward_text(cell["mean_reward"])
        if interval:
            yield "95 % interval without noise", interval
    played = [cell for cell in cells if not cell["reference"]]
    if len(played) > 1:
        yield "mean rewards, lowest to highest", _range_words(cells)
    if played:
        differences = [
            (cell["paired_difference"], cell["mean_reward"])
            for cell in played
            if cell["paired_difference"] is not None
        ]
        if differences:
            low, high = (difference_text(*edge(differences)) for edge in (min, max))
            yield (
                ("difference to ideal", low)
                if len(differences) == 1
                else ("differences to ideal, lowest to highest", f"{low} to {high}")
            )


def _results(
    cells: Sequence[Mapping[str, Any]],
    policies: Sequence[str],
    draw: Callable[[str, AnyStyle], Figure],
) -> Iterator[Block]:
    for policy in policies:
        own = [cell for cell in cells if cell["policy"] == policy]
        if len(policies) > 1:
            yield Heading(policy)

        def of_policy(style: AnyStyle, policy: str = policy) -> Figure:
            return draw(policy, style)

        words = "The table below has the same numbers."
        if not all(map(interval_words, own)):
            words += " Cells of few episodes have no interval."
        yield Picture.of(f"Mean rewards of {policy}", of_policy, words)
        table = grid_table(own)
        played = [index for index, cell in enumerate(own) if not cell["reference"]]
        best = max(played, key=lambda index: float(own[index]["mean_reward"]), default=None)
        yield Table(
            f"Results of {policy}",
            table.header[1:],
            [row[1:] for row in table.words],
            "to ideal: the mean of the differences to the same episodes without noise. The best "
            "row that is not the reference is marked."
            if best is not None
            else "",
            frozenset() if best is None else frozenset({best}),
        )


def _episodes(cells: Sequence[Mapping[str, Any]], policies: Sequence[str]) -> Iterator[Block]:
    for policy in policies:
        own = [cell for cell in cells if cell["policy"] == policy and cell["episodes"]]
        samples = [
            Sample(
                _name(cell),
                [episode["reward"] for episode in cell["episodes"]],
                cell["ci95"] if interval_words(cell) else None,
                grey=cell["reference"],
            )
            for cell in own[:_MOST_SAMPLES]
        ]

        def draw(style: AnyStyle, samples: Sequence[Sample] = samples) -> Figure:
            return draw_distributions("", samples, style)

        more = len(own) - len(samples)
        words = f" {plural(more, 'more cell')} are in the table." if more else ""
        yield Picture.of(
            f"Distribution of the rewards of {policy}",
            draw,
            f"A histogram for each cell; grey is the policy without noise.{words}",
        )


def _settings(cells: Sequence[Mapping[str, Any]]) -> Iterator[Block]:
    if not cells:
        return
    names = {
        "policies": "policy",
        "backends": "backend",
        "shots": "shots",
        "mitigations": "mitigation",
        "calibrations": "calibration",
        "levels": "level",
        "seed": "seed",
    }
    facts = []
    for name, key in names.items():
        values = [*dict.fromkeys(str(c[key]) for c in cells if c.get(key) is not None)]
        if values:
            facts.append((name, ", ".join(values)))
    facts.insert(1, ("environments", ", ".join(dict.fromkeys(map(environment_words, cells)))))
    if any(cell.get("hold", 1) > 1 for cell in cells):
        held = {cell["policy"]: hold_text(cell.get("hold", 1)) for cell in cells}
        texts = held.values() if len(held) == 1 else (": ".join(pair) for pair in held.items())
        facts.append(("each decision", "; ".join(texts)))
    facts.append(("episodes of a cell", str(len(cells[0]["episodes"]))))
    facts.append(("actions", "the likeliest" if cells[0]["greedy"] else "sampled"))
    yield Facts(facts)
