"""The result of a run, and its load on a machine."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.deploy.lockstep import Episode
from qcompile.deploy.player import Player
from qcompile.deploy.rows import Rows
from qcompile.execution import Workload

_MIN_FOR_SOLVED = 100


@dataclass
class Run:
    """The finished `episodes` of a run, `cut_episodes` of them stopped by `max_steps`.

    `threshold` is the mean reward at which the environment counts as solved, if it defines one.
    `decisions` and `env_steps` cover every episode, finished or not; `measured_rows` counts all
    measured rows, including those discarded when steps are measured ahead. `completed` (episodes,)
    are the rewards with cut episodes completed; None if none was.
    """

    player: Player
    threshold: float | None = None
    episodes: list[Episode] = field(default_factory=list)
    programs: Counter[int] = field(default_factory=Counter)
    """The number of steps for each number of program executions."""
    measured_rows: int = 0
    decisions: int = 0
    env_steps: int = 0
    cut_episodes: int = 0
    completed: FloatArray | None = None
    wall_seconds: float = 0.0
    interrupted: bool = False

    def count_step(self, rows: Rows) -> None:
        """Count a step with these rows: one job, or several if it is too large for one."""
        self.measured_rows += len(rows.episode)
        self.programs[self.player.executions(rows)] += 1

    @property
    def steps(self) -> int:
        """The number of lockstep steps."""
        return self.programs.total()

    @property
    def load(self) -> Workload:
        """Jobs and executions of the episodes."""
        load = Workload()
        for programs, steps in self.programs.items():
            load += self.player.load(programs) * steps
        return load

    @property
    def rewards(self) -> FloatArray:
        return np.array([episode.reward for episode in self.episodes])

    @property
    def total_load(self) -> Workload:
        """Jobs and executions (circuits after packing times shots), with the calibration's."""
        return self.load + self.player.calibration_load

    def summary(self) -> dict[str, Any]:
        """The plain values of `qcompile run --json`."""
        player, rewards = self.player, self.rewards
        policy, settings = player.policy, player.settings
        shots, load, completed = settings.shots, self.total_load, self.completed
        # In an interrupted run the shortest episodes finish first, which biases their mean.
        is_unbiased = not self.interrupted and settings.max_steps is None
        # When measuring ahead, so do episodes whose predictions were right.
        has_mean = len(rewards) > 0 and not (self.interrupted and settings.speculate != 1)
        arguments = dict(policy.environment_kwargs)
        return {
            "policy": policy.name,
            "environment": policy.environment,
            **({"environment_kwargs": arguments} if arguments else {}),
            "backend": player.backend,
            "kind": player.kind,
            "shots": "exact" if shots is None else shots,
            "mitigation": settings.mitigation,
            "predistort": settings.predistort,
            "calibration": settings.calibration_file,
            "calibration_misfits": [misfit.values() for misfit in player.misfits],
            "copies": settings.copies or 1,
            "split": settings.split,
            "calibration_shots": player.calibration_shots,
            "level": settings.level,
            "greedy": settings.greedy,
            "seed": settings.seed,
            "episodes": [vars(episode) for episode in self.episodes],
            "mean_reward": float(rewards.mean()) if has_mean else None,
            "std_reward": float(rewards.std()) if has_mean else None,
            "ci95": None if self.interrupted else bootstrap_ci95(rewards, settings.seed),
            "solved": is_solved(rewards, self.threshold) if is_unbiased else None,
            **player.sizes(),
            "max_steps": settings.max_steps,
            "cut_episodes": self.cut_episodes,
            "mean_reward_completed": None if completed is None else float(completed.mean()),
            "ci95_completed": (
                None if completed is None else bootstrap_ci95(completed, settings.seed)
            ),
            "jobs": 0 if shots is None else load.jobs,
            "executions": load.executions,
            "qpu_seconds_estimate": None if shots is None else load.qpu_seconds,
            "hold": policy.hold,
            "speculate": settings.speculate,
            "measured_rows": self.measured_rows,
            "decisions": self.decisions,
            "env_steps": self.env_steps,
            "wall_seconds": self.wall_seconds,
            "interrupted": self.interrupted,
        }


def is_solved(rewards: FloatArray, threshold: float | None) -> bool | None:
    """Whether the mean reward reaches the threshold; None without one, or with too few rewards."""
    if threshold is None or len(rewards) < _MIN_FOR_SOLVED:
        return None
    return float(rewards.mean()) >= threshold
