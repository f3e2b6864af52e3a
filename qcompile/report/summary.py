"""Print the result of a run, line by line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from qcompile.mitigation import CALIBRATION_SHOTS
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.notebook import reward_form, reward_text
from qcompile.policy.decision import hold_text
from qcompile.report.tables import cost_in_words, interval_words, plural, wide_console

_KINDS = {
    "ideal": "ideal simulation",
    "noise-model": "noise model",
    "measured-response": "twin of a calibration",
    "hardware": "hardware",
}
_BARS = "▁▂▃▄▅▆▇█"
_HOUR_S = 3600


def print_run(summary: dict[str, Any]) -> None:
    """Print the result of a run: `Run.summary`."""
    out = wide_console()
    backend = f"{summary['backend']} ({kind_words(summary['kind'])})"
    policy, environment = escape(summary["policy"]), escape(summary["environment"])
    out.print(f"[bold]{policy}[/] in {environment} on {escape(backend)}")
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column()
    lines = _reward_lines, _setting_lines, _cost_lines, _run_lines
    for name, value in chain.from_iterable(of(summary) for of in lines):
        grid.add_row(name, value)
    out.print(grid)


def run_facts(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The lines of `print_run` below those on the rewards and above the cost, as plain text."""
    lines = (*_setting_lines(summary), *_run_lines(summary))
    return [(name, Text.from_markup(words).plain) for name, words in lines]


def interruption(summary: Mapping[str, Any], requested: int) -> list[str]:
    """That Ctrl-C ended a run of `requested` episodes, and what it means; empty if it did not."""
    if not summary["interrupted"]:
        return []
    finished = len(summary["episodes"])
    words = f"Interrupted: {finished} of {requested} episodes finished."
    bias = "These are the shortest ones: their mean does not estimate the policy's score."
    if summary["speculate"] != 1:
        bias = "Which ones finished depends on the predictions, so no mean is reported."
    return [words, bias] if finished else [words]


def caveats(summary: Mapping[str, Any]) -> list[str]:
    """What a reader must know before the mean reward, of the lines of `print_run`."""
    lines = [*_equal_lines(summary), *(_cut_lines(summary) if summary.get("cut_episodes") else [])]
    words = [Text.from_markup(f"{name.capitalize()}: {words}").plain for name, words in lines]
    return [*words, *misfit_warnings(summary.get("calibration_misfits", []))]


def kind_words(kind: str) -> str:
    """What results of a backend of that kind are."""
    return _KINDS.get(kind, kind)


def _reward_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    rewards = [episode["reward"] for episode in summary["episodes"]]
    if rewards:
        interval = interval_words(summary)
        interval = f" (95 % interval {interval})" if interval else ""
        if summary["mean_reward"] is not None:
            mean, _, deviation = reward_text(summary["mean_reward"], summary["std_reward"]).split()
            yield (
                "mean reward",
                f"[bold]{mean}[/] ± {deviation} over {plural(len(rewards), 'episode')}{interval}",
            )
        low, high = min(rewards), max(rewards)
        form = reward_form(low, high)
        yield "rewards", f"{_bars(rewards)}  {low:{form}} to {high:{form}}"
        yield from _equal_lines(summary)


def _equal_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    from qcompile.deploy.intervals import unseen_share

    rewards = [episode["reward"] for episode in summary["episodes"]]
    if interval_words(summary) and min(rewards) == max(rewards):
        share = f"{100 * unseen_share(len(rewards)):.0f} %"
        yield (
            "all equal",
            f"up to {share} of all episodes may still have other rewards, with 95 % confidence",
        )


def _setting_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    if summary["solved"] is not None:
        yield "solved", "yes" if summary["solved"] else "no"
    if arguments := summary.get("environment_kwargs"):
        text = ", ".join(f"{name}={json.dumps(value)}" for name, value in arguments.items())
        yield "environment", escape(text)
    if summary["circuits_per_step"]:
        yield "settings", _circuit_settings(summary)
    for words in misfit_warnings(summary.get("calibration_misfits", [])):
        yield "warning", words
    if summary["copies"] > 1 and not summary.get("split"):
        yield "copies", f"{summary['copies']} on the device at once, each with its own episode"
    if summary.get("speculate", 1) != 1:
        yield (
            "speculate",
            f"{summary['speculate']}: {plural(summary['measured_rows'], 'decision')} measured, "
            f"{summary['decisions']} of them used",
        )
    yield from _cut_lines(summary)
    yield "actions", f"{'greedy' if summary['greedy'] else 'sampled'}, seed {summary['seed']}"
    hold, steps = summary.get("hold", 1), f"{summary['env_steps']} steps"
    if hold > 1:
        yield "each decision", f"{_step_words(summary)}; {hold_text(hold)}"
        decisions = plural(summary["decisions"], "decision")
        steps = f"{decisions}, {plural(summary['env_steps'], 'environment step')}"
    else:
        yield "each step", _step_words(summary)
    yield "played", f"{steps} in {summary['wall_seconds']:.1f} s"


def _cost_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    """What the run took, or would take, on a machine."""
    if "run" in summary:
        yield (
            "paid",
            f"{plural(summary['jobs'], 'job')}, {summary['executions']:,} executions, "
            f"{cost_in_words(summary)}; the limit is {summary['max_qpu_seconds']:g}",
        )
    elif summary["qpu_seconds_estimate"] is not None and summary["kind"] != "ideal":
        yield (
            "on hardware",
            f"would take {plural(summary['jobs'], 'job')}, {summary['executions']:,} executions, "
            f"about {_qpu_words(summary['qpu_seconds_estimate'])}",
        )


def _run_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    if "run" in summary:
        yield "run", summary["run"]


def _qpu_words(seconds: float) -> str:
    """QPU time in seconds or hours, whichever is the shorter number."""
    if seconds < _HOUR_S:
        return f"{seconds:.0f} QPU seconds"
    return f"{seconds / _HOUR_S:,.1f} QPU hours"


def _cut_lines(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    """The episodes that `max_steps` cut, and the mean reward without the cut."""
    if summary["max_steps"] is None:
        return
    after = f"after {plural(summary['max_steps'], 'step')}"
    cut = summary.get("cut_episodes")
    if cut is None:  # results of earlier versions
        yield "cut", f"{after}; rewards count the part played"
        return
    if not cut:
        yield "cut", f"no episode {after}"
        return
    yield "cut", f"{plural(cut, 'episode')} {after}; rewards count the part played"
    if (mean := summary.get("mean_reward_completed")) is None:
        yield "uncut", "mean reward not known: an episode did not end, or failed"
        return
    interval = interval_words(summary, "ci95_completed")
    interval = f" (95 % interval {interval})" if interval else ""
    on = " on the noise model" * (summary["kind"] == "hardware")
    yield (
        "uncut",
        f"mean reward {reward_text(mean)}{interval} with all episodes played to the end{on}",
    )


def _circuit_settings(summary: Mapping[str, Any]) -> str:
    mitigation = f"mitigation {summary['mitigation']}"
    words = "predistorted angles" if summary["predistort"] else mitigation
    source = f" from {escape(file)}" if (file := summary["calibration"]) else ""
    if (shots := summary.get("calibration_shots")) not in (None, CALIBRATION_SHOTS):
        source = f" calibrated with {_shots(shots)}"
    copies = f" split over {summary['copies']} copies" if summary.get("split") else ""
    return f"{_shots(summary['shots'])}{copies}, level {summary['level']}, {words}{source}"


def _step_words(summary: Mapping[str, Any]) -> str:
    if not summary["circuits_per_step"]:
        return "a network, without circuits"
    gates = " + ".join(f"{n} {gate}" for gate, n in summary["gates_per_circuit"].items() if n)
    circuits = summary["circuits_per_step"]
    parts = [f"{plural(circuits, 'circuit')} of at most {gates or 'no gate'}"]
    if summary.get("observables_per_step", circuits) != circuits:
        parts.append(plural(summary["observables_per_step"], "observable"))
    return ", ".join([*parts, plural(summary["rounds_per_step"], "round")])


def _shots(shots: int | str) -> str:
    return f"{shots} expectations" if isinstance(shots, str) else plural(shots, "shot")


def _bars(values: Sequence[float]) -> str:
    """A bar for each of the first 40 values, scaled from the least to the greatest."""
    high, span = max(values), (max(values) - min(values)) or 1.0
    drawn = values[:40]
    bars = "".join(_BARS[-1 - round((high - v) / span * (len(_BARS) - 1))] for v in drawn)
    return bars + ("…" if len(values) > len(drawn) else "")
