"""Write up the paper's device tests: a figure of three panels, and a page of tables."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from qcompile.deploy.intervals import unseen_share
from qcompile.errors import StudyError
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel
from qcompile.report.tables import interval_words, plural
from qcompile.sweep.evaluation.cell import CellResult
from qcompile.sweep.evaluation.grid import Cell
from qcompile.sweep.evaluation.paper import TASKS, DeviceTest, Score
from qcompile.sweep.evaluation.summary import results
from qcompile.sweep.evaluation.write_up import interval, mitigation_words, reference_line
from qcompile.sweep.pages import link, markdown_table, version_words, write_files

Objects = Sequence[Mapping[str, Any]]

_PAPER = "the paper, mean ± std of about 5 episodes"

_TITLE = "The paper's devices: the shipped policies on their noise models"

_HEAD = """\
# The paper's devices, on their noise models

This page is written by `qcompile evaluate --paper` from the results in {folder};
no number on it is typed by hand.

The paper (arXiv 2203.14348) tests its policies on five IBM devices that have been retired. Here the
shipped policies play {episodes} on noise models of the same devices. The noise models are made from
the numbers printed in the paper, with the paper's numbers of shots, without mitigation and with
`readout`. The paper's scores are shown for comparison, but three things differ: these are noise
models, not machines; the policies are our own; and LunarLander-v3 has replaced LunarLander-v2.

![Mean rewards on the paper's devices]({figure})

How to read the tables:

- **mean ± std**: reward over the episodes, with sampled actions; the paper's are over about five.
- **95 % interval**: of the mean; the wider of Student's t and the studentised bootstrap. If all
  rewards are equal it has no width, but up to {unseen:.1%} of all episodes may have other rewards.
- **to ideal**: mean difference to the same policy on `ideal` with exact expectations, over episodes
  with the same resets, with its 95 % interval; for the paper, the difference of its two means.
"""

_COLUMNS = ("backend", "shots", "mitigation", "mean ± std", "95 % interval", "to ideal")


def write_devices(
    cells: Sequence[Cell], played: Mapping[str, CellResult], folder: Path, page_path: Path
) -> list[Path]:
    """Write devices.png and the page; their paths.

    Raises:
        OutputError: one of them cannot be written.
        StudyError: a cell is missing.
    """
    objects = results(cells, played)
    if len(objects) < len(cells):
        raise StudyError(f"{len(cells) - len(objects)} of {len(cells)} cells are missing.")
    versions = played[cells[0].name].versions
    text = page(cells, objects, link(folder, page_path), versions, (folder, page_path))
    picture = draw_intervals(_TITLE, panels(objects)).png
    return write_files({folder / "devices.png": picture, page_path: text.encode()})


def panels(objects: Objects) -> list[Panel]:
    """A panel for each task: our results on every device, then the paper's two scores."""
    panels = []
    for task in TASKS:
        played = _of_task(task, objects)
        intervals = [_interval(values) for values in played if not values["reference"]]
        intervals += [
            _claimed("the paper,\ndevices", task.on_devices),
            _claimed("the paper,\nideal", task.ideal),
        ]
        title = f"{task.environment}, {task.shots} shots"
        solved = played[0]["threshold"]
        panels.append(Panel(title, intervals, reference_line(played), solved, scale=title))
    return panels


def _interval(values: Mapping[str, Any]) -> Interval:
    return replace(interval(values), variant="", shots=None)


def _claimed(column: str, score: Score) -> Interval:
    low, high = score.mean - score.std, score.mean + score.std
    return Interval(column, _PAPER, "", score.mean, low, high, grey=True)


def _of_task(task: DeviceTest, objects: Objects) -> list[Mapping[str, Any]]:
    key = (task.policy, task.environment)
    return [values for values in objects if (values["policy"], values["environment"]) == key]


def page(
    cells: Sequence[Cell],
    objects: Objects,
    folder: str,
    versions: Mapping[str, str],
    written: tuple[Path, Path],
) -> str:
    """The page, in Markdown; `folder` is that of the figure, relative to the page.

    `written` are the folder and the page as given to the running command.
    """
    inside = "" if folder == "." else f"{folder}/"
    where = f"[{PurePosixPath(folder).name if inside else 'this folder'}]({inside}results.csv)"
    first = cells[0]
    figure = f"{inside}devices.png"
    parts = [
        _HEAD.format(
            folder=where,
            episodes=plural(first.episodes, "episode"),
            figure=figure,
            unseen=unseen_share(first.episodes),
        )
    ]
    for task in TASKS:
        policy = next(cell.policy for cell in cells if cell.policy.name == task.policy)
        first_result = _of_task(task, objects)[0]
        threshold, circuits = first_result["threshold"], first_result["circuits_per_step"]
        solved = "has no threshold" if threshold is None else f"counts as solved at {threshold:g}"
        parts.append(
            f"## {task.title}\n\nThe policy `{task.policy}` plays {task.environment}, which "
            f"{solved}.\nIt has {plural(circuits, 'circuit')} and "
            f"{policy.parameter_count} trained numbers; the paper's has "
            f"{plural(task.circuits, 'circuit')} and {task.parameters}.\n"
        )
        parts.append(_table(task, objects))
    parts.append(
        f"## Repeat it\n\n```\n{_command(first, *written)}\n```\n\n"
        f"Made with {version_words(versions)}, seed {first.seed}.\nThe same versions on the same "
        "machine give the same numbers, with any number of workers.\n"
    )
    return "\n".join(parts)


def _command(cell: Cell, folder: Path, page: Path) -> str:
    words = ["--episodes", cell.episodes, "--seed", cell.seed, "--out", folder, "--page", page]
    return shlex.join(["qcompile", "evaluate", "--paper", *map(str, words)])


def _table(task: DeviceTest, objects: Objects) -> str:
    on_devices, ideal = task.on_devices, task.ideal
    lines = [
        *map(_cells, _of_task(task, objects)),
        ("the paper, ideal simulator", "-", "-", f"{ideal.mean:.1f} ± {ideal.std:.1f}", "-", "-"),
        (
            "the paper, on its devices",
            f"{task.shots}",
            "-",
            f"{on_devices.mean:.1f} ± {on_devices.std:.1f}",
            "-",
            f"{on_devices.mean - ideal.mean:+.1f}",
        ),
    ]
    return markdown_table(_COLUMNS, lines)


def _cells(values: Mapping[str, Any]) -> tuple[str, ...]:
    difference = "-"
    if not values["reference"]:
        difference = f"{values['paired_difference']:+.1f}"
        if values["paired_ci95"] is not None:
            least, most = values["paired_ci95"]
            difference += f" ({least:+.1f} to {most:+.1f})"
    return (
        f"`{values['backend']}`",
        f"{values['shots']}",
        "-" if values["reference"] else mitigation_words(values["mitigation"]),
        f"{values['mean_reward']:.1f} ± {values['std_reward']:.1f}",
        interval_words(values) or "-",
        difference,
    )
