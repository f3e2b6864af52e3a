"""The paper's device tests: its tasks, and what it reports of them (arXiv 2203.14348)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from qcompile.device import load_device
from qcompile.execution import DeviceBackend
from qcompile.policy import load_policy
from qcompile.sweep.evaluation.grid import Cell, grid


@dataclass(frozen=True)
class Score:
    """A mean reward and its standard deviation over about five episodes."""

    mean: float
    std: float


@dataclass(frozen=True)
class Task:
    """One of the paper's device tests.

    `policy` is ours, shipped, and plays in `environment`; `circuits` and `parameters` are the
    paper's own, as is its `title`. The paper gives one score for all of a task's devices.
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


TASKS = (
    Task(
        "CartPole-v0",
        "cartpole_1q",
        "CartPole-v0",
        ("ibm_lagos", "ibm_belem"),
        1024,
        1,
        5,
        Score(194.0, 8.12),
        Score(200.0, 0.0),
    ),
    Task(
        "Acrobot-v1",
        "acrobot",
        "Acrobot-v1",
        ("ibm_lagos", "ibm_belem"),
        1024,
        6,
        27,
        Score(-90.04, 5.03),
        Score(-84.40, 18.8),
    ),
    Task(
        "LunarLander-v2",
        "lunarlander",
        "LunarLander-v3",
        ("ibm_lima", "ibm_jakarta", "ibm_toronto"),
        8192,
        24,
        124,
        Score(198.3, 19.3),
        Score(253.4, 17.1),
    ),
)


def paper_cells(episodes: int, seed: int) -> list[Cell]:
    """The cells of every task: its devices at its shots, without mitigation and with `readout`."""
    cells = []
    for task in TASKS:
        policy = replace(load_policy(task.policy), environment=task.environment)
        backends = [DeviceBackend(load_device(name)) for name in task.devices]
        mitigations = ("none", "readout")
        cells += grid([policy], backends, [task.shots], mitigations, episodes=episodes, seed=seed)
    return cells
