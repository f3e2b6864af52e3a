"""The paper's device tests: its tasks, and the scores that it reports (arXiv 2203.14348)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from qcompile.device import load_device
from qcompile.execution import DeviceBackend
from qcompile.policy import load_policy
from qcompile.reading import read_toml
from qcompile.sweep.evaluation.grid import Cell, grid


@dataclass(frozen=True)
class Score:
    """A mean reward and its standard deviation over about five episodes."""

    mean: float
    std: float


@dataclass(frozen=True)
class DeviceTest:
    """One of the paper's device tests.

    `policy` is a shipped policy that plays in `environment`; `circuits`, `parameters` and `title`
    are the paper's. The paper gives one score for all devices of a task.
    """

    title: str
    policy: str
    environment: str
    devices: tuple[str, ...]
    shots: int
    circuits: int
    parameters: int
    on_devices: Score
    ideal: Score


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    tasks: tuple[DeviceTest, ...]


TASKS = _File.model_validate(read_toml(Path(__file__).with_name("paper.toml"))).tasks


def paper_cells(episodes: int, seed: int) -> list[Cell]:
    """The cells of every task: its devices at its shots, without mitigation and with `readout`."""
    cells = []
    for task in TASKS:
        policy = replace(load_policy(task.policy), environment=task.environment)
        backends = [DeviceBackend(load_device(name)) for name in task.devices]
        mitigations = ("none", "readout")
        cells += grid([policy], backends, [task.shots], mitigations, episodes=episodes, seed=seed)
    return cells
