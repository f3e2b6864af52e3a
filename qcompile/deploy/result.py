"""What a run found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.deploy.lockstep import Episode
from qcompile.execution import Workload

_LEAST_FOR_SOLVED = 100


@dataclass
class RunResult:
    """What a run found; `episodes` are those that finished.

    `threshold` is the mean reward at which the environment counts as solved, if it has one;
    `steps` counts the steps of the lockstep, `env_steps` those of every environment, `load` the
    jobs and executions for them: a program for as many episodes as the deployment has copies.
    Episodes longer than `max_steps` were cut.
    """

    deployment: Deployment
    threshold: float | None = None
    max_steps: int | None = None
    episodes: list[Episode] = field(default_factory=list)
    load: Workload = field(default_factory=Workload)
    steps: int = 0
    env_steps: int = 0
    wall_seconds: float = 0.0
    interrupted: bool = False

    def count_step(self, living: int) -> None:
        """Count a step of `living` episodes: one job, or more where a job cannot hold it."""
        made = self.deployment
        self.steps += 1
        self.env_steps += living
        programs = -(-living // made.copies)
        self.load += Workload.of_batch(programs, made.executable.round_count, made.shots or 0)

    @property
    def rewards(self) -> FloatArray:
        return np.array([episode.reward for episode in self.episodes])

    @property
    def total_load(self) -> Workload:
        """Jobs and executions (circuits after packing times shots), with the calibration's."""
        return self.load + self.deployment.calibration_load

    def summary(self, calibration: str | None = None) -> dict[str, Any]:
        """The plain values of `qcompile run --json`; `calibration` is the name of its file."""
        made, rewards = self.deployment, self.rewards
        policy, counts = made.policy, made.executable.gate_counts()
        mean = float(rewards.mean()) if len(rewards) else None
        # Of an interrupted run the shortest episodes ended first: their mean is biased.
        judged = not self.interrupted and self.max_steps is None
        return {
            "policy": policy.name,
            "environment": policy.environment,
            "backend": made.device.name,
            "kind": made.executor.kind,
            "shots": "exact" if made.shots is None else made.shots,
            "mitigation": made.mitigation,
            "predistort": made.predistort,
            "calibration": calibration,
            "calibration_misfits": [misfit.values() for misfit in made.misfits],
            "copies": made.copies,
            "level": made.level,
            "greedy": made.greedy,
            "seed": made.seed,
            "episodes": [vars(episode) for episode in self.episodes],
            "mean_reward": mean,
            "std_reward": float(rewards.std()) if len(rewards) else None,
            "ci95": None if self.interrupted else bootstrap_ci95(rewards, made.seed),
            "solved": is_solved(rewards, self.threshold) if judged else None,
            "gates_per_circuit": {
                gate: max((count[gate] for count in counts), default=0)
                for gate in ("sx", "rz", "x", "rx")
            },
            "circuits_per_step": len(policy.program),
            "rounds_per_step": made.executable.round_count,
            "max_steps": self.max_steps,
            "jobs": 0 if made.shots is None else self.total_load.jobs,
            "executions": self.total_load.executions,
            "qpu_seconds_estimate": None if made.shots is None else self.total_load.qpu_seconds,
            "env_steps": self.env_steps,
            "wall_seconds": self.wall_seconds,
            "interrupted": self.interrupted,
        }


def is_solved(rewards: FloatArray, threshold: float | None) -> bool | None:
    """Whether their mean reaches the threshold; None without one, or where they are too few."""
    if threshold is None or len(rewards) < _LEAST_FOR_SOLVED:
        return None
    return float(rewards.mean()) >= threshold
