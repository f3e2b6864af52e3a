"""The report of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from qcompile.notebook import reward_text
from qcompile.page.circuits import Compiled, circuits_section
from qcompile.page.document import (
    Block,
    Document,
    Facts,
    Film,
    Picture,
    Score,
    Section,
    Table,
)
from qcompile.page.placement import placement_section
from qcompile.page.words import without_folders
from qcompile.report.clip import Clip
from qcompile.report.distribution import Sample, draw_distributions
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.summary import kind_words, run_facts
from qcompile.report.tables import environment_words, interval_words, plural

_MOST_BARS = 60
_MOST_ROWS = 500
_PACKAGES = ("numpy", "gymnasium", "torch", "qiskit", "qiskit-aer", "qiskit-ibm-runtime")


def run_document(
    summary: Mapping[str, Any],
    draw: Callable[[AnyStyle], Figure],
    compiled: Compiled | None = None,
    clip: Clip | None = None,
    *,
    warnings: Sequence[str] = (),
    command: str = "",
) -> Document:
    """The report of a run: `summary` is the document of `qcompile run --json`.

    `draw` draws its rewards; `compiled` is what was played, `clip` the film of its first episode.
    """
    episodes = summary["episodes"]
    played = [] if compiled is None else [compiled]
    return Document(
        "run",
        f"{summary['policy']} on {summary['backend']}",
        f"{plural(len(episodes), 'episode')} of {environment_words(summary)}, played on "
        f"{summary['backend']} ({kind_words(summary['kind'])}).",
        _score(summary),
        [*_headline(summary)],
        [
            Section("Film", [] if clip is None else [_film(clip, summary)]),
            Section("Episodes", [*_episodes(summary, draw)]),
            circuits_section(played),
            placement_section(played),
            Section("Budget", [*_budget(summary)]),
            Section("Settings", [Facts(_settings(summary))]),
        ],
        warnings,
        _PACKAGES,
        command=command,
    )


def _settings(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The settings; a calibration by the name of its file."""
    file = summary["calibration"]
    named = {"calibration": None if file is None else without_folders(file)}
    return run_facts({**summary, **named})


def _film(clip: Clip, summary: Mapping[str, Any]) -> Film:
    words = f"{summary['policy']} on {summary['backend']}: the environment"
    if summary["circuits_per_step"]:
        words += ", the <Z> of its circuits as measured and without noise"
        words += ", the qubits of the device" * bool(summary.get("couplings_per_circuit"))
    words += ", the probabilities of the actions, and the reward so far"
    return Film("The first episode", clip.media_type, clip.data, clip.poster, f"{words}.")


def _score(summary: Mapping[str, Any]) -> Score | None:
    if summary["mean_reward"] is None:
        return None
    interval = interval_words(summary)
    words = f"95 % interval {interval}" if interval else "too few episodes for an interval"
    if summary["interrupted"]:
        words = "of the shortest episodes"
    return Score("mean reward", reward_text(summary["mean_reward"]), interval=words)


def _headline(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    rewards = [episode["reward"] for episode in summary["episodes"]]
    yield "episodes", str(len(rewards))
    if rewards:
        low, high = reward_text(min(rewards)), reward_text(max(rewards))
        yield "lowest to highest reward", f"{low} to {high}"
    if summary["std_reward"] is not None:
        yield "standard deviation", reward_text(summary["std_reward"])
    if summary["solved"] is not None:
        yield "solved", "yes" if summary["solved"] else "no"
    if circuits := summary["circuits_per_step"]:
        rounds = plural(summary["rounds_per_step"], "round")
        yield "circuits per decision", f"{circuits} in {rounds}"
        if couplings := summary.get("couplings_per_circuit"):
            yield "couplings per circuit", str(couplings)
        if (observables := summary.get("observables_per_step", circuits)) != circuits:
            yield "observables per decision", str(observables)
        shots = summary["shots"]
        yield "shots per circuit", f"{shots:,}" if isinstance(shots, int) else "exact"
        mitigation = "predistorted angles" if summary["predistort"] else summary["mitigation"]
        yield "mitigation", mitigation


def _episodes(summary: Mapping[str, Any], draw: Callable[[AnyStyle], Figure]) -> Iterator[Block]:
    episodes = summary["episodes"]
    if not episodes:
        return
    rewards = [episode["reward"] for episode in episodes]
    ci95 = summary["ci95"] if interval_words(summary) else None
    sample = Sample(summary["policy"], rewards, ci95)
    words = (
        f"{plural(len(rewards), 'episode')} from {reward_text(min(rewards))} to "
        f"{reward_text(max(rewards))}"
    )
    yield Picture.of(
        "Distribution of the rewards",
        lambda style: draw_distributions("", [sample], style, row_in=1.6),
        f"{words}.",
    )
    if 1 < len(rewards) <= _MOST_BARS:
        yield Picture.of("Reward of each episode", draw, "One bar per episode, in order.")
    rows = [
        [str(index), str(episode["seed"]), reward_text(episode["reward"]), str(episode["length"])]
        for index, episode in enumerate(episodes[:_MOST_ROWS])
    ]
    more = len(episodes) - len(rows)
    note = f"{plural(more, 'more episode')}: the results in JSON have them all." if more else ""
    columns = ["episode", "seed", "reward", "steps"]
    yield Table("Every episode", columns, rows, note, folded=True)


def _budget(summary: Mapping[str, Any]) -> Iterator[Block]:
    """What the run took or would take on a machine."""
    seconds = summary["qpu_seconds_estimate"]
    if not summary["circuits_per_step"] or (seconds is None and "run" not in summary):
        return
    facts = [("jobs", f"{summary['jobs']:,}"), ("executions", f"{summary['executions']:,}")]
    if "run" in summary:
        facts += [
            ("QPU seconds charged", f"{summary['qpu_seconds_settled']:,.1f}"),
            ("QPU seconds at most", f"{summary['qpu_seconds']:,.1f}"),
            ("QPU seconds allowed", f"{summary['max_qpu_seconds']:g}"),
        ]
    else:
        facts.append(("QPU seconds on a machine", f"about {seconds:,.0f}"))
    yield Facts(facts)
