"""Play episodes with a policy on a backend, all in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.errors import CountsError
from qcompile.execution import Backend, Executor, Workload, open_executor
from qcompile.limits import MAX_EPISODES
from qcompile.policy import Policy
from qcompile.rl.environments import (
    Environment,
    check_fit,
    close_environments,
    make_environments,
    reward_threshold,
)
from qcompile.rl.intervals import bootstrap_ci95
from qcompile.rl.lockstep import Act, Episode, Frame, lockstep
from qcompile.rl.measurement import Measurement

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

_LEAST_FOR_SOLVED = 100
_NO_THETA = np.zeros(0)


class Deployment:
    """A policy compiled for a device: from observations to actions.

    `shots` None takes expectations without shot noise. Shot noise, calibration and the sampling
    of actions draw from generators derived from `seed`, so a deployment repeats exactly. With
    `copies` so many episodes share an execution, their circuits side by side on the device.
    `misfits` are the fits of its calibration that contradict their own counts.

    Raises:
        CalibrationError: `mitigation` is not one of MITIGATIONS, or a qubit cannot be calibrated.
        CircuitError: copies are out of range.
        CountsError: shots out of range.
    """

    def __init__(
        self,
        policy: Policy,
        backend: str | Device | Backend | Executor,
        *,
        shots: int | None = None,
        level: int = 2,
        mitigation: str = "none",
        calibration: Calibration | None = None,
        predistort: bool = False,
        greedy: bool = False,
        seed: int = 0,
        copies: int = 1,
    ):
        self.policy, self.shots, self.copies = policy, shots, copies
        self.predistort = predistort
        self.level, self.mitigation, self.greedy, self.seed = level, mitigation, greedy, seed
        noise_seed, action_seed = np.random.SeedSequence(seed).spawn(2)
        self._rng = np.random.default_rng(action_seed)
        self._measure = Measurement(
            policy.trained_program,
            open_executor(backend, noise_seed),
            shots=shots,
            level=level,
            mitigation=mitigation,
            calibration=calibration,
            predistort=predistort,
            importance=policy.importance,
            copies=copies,
        )
        self.calibration_load = self._measure.calibration_load
        self.misfits = self._measure.misfits
        self.executor, self.executable = self._measure.executor, self._measure.executable
        self.device = self.executor.device

    def expectation(self, observations: FloatArray) -> FloatArray:
        """`<Z>` of every circuit as measured and mitigated, (B, circuits)."""
        return self._measure(self.policy.encode(observations), _NO_THETA)

    def act(self, observations: FloatArray) -> IntArray:
        """An action for each of the observations (B, features)."""
        z = self.expectation(observations)
        return self.policy.greedy(z) if self.greedy else self.policy.sample(z, self._rng)


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


class Record(Protocol):
    """Keeps the steps of a run."""

    def act(self, act: Act, observations: FloatArray) -> IntArray:
        """The actions (B,) for observations (B, features), which `act` may be asked for."""
        ...

    def rewards(self, rewards: list[float]) -> None:
        """What the episodes of the last step earned by its actions."""
        ...


def _drop(rewards: list[float]) -> None:
    """Nobody records them."""


def play(
    deployment: Deployment,
    episodes: int,
    *,
    max_steps: int | None = None,
    record: Record | None = None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
    on_frame: Callable[[Frame, float], None] | None = None,
) -> RunResult:
    """Play `episodes` episodes in lockstep; episode i resets with the deployment's seed + i.

    All living episodes step together: one batch of circuits, one job. An episode ends after
    `max_steps`. Ctrl-C ends the run and keeps what is finished; `record` sees every step.
    `on_frame` gets the frames of the first episode, (height, width, 3), and how many of them make a
    second.

    Raises:
        CountsError: episodes lie outside [1, MAX_EPISODES].
        EnvironmentMismatchError: the environment is unknown or does not fit the policy.
        EnvironmentStepError: it fails in an episode, or gives what no policy can use.
    """
    if not 1 <= episodes <= MAX_EPISODES:
        raise CountsError(
            f"{episodes} episodes cannot be played.", f"Their number lies in [1, {MAX_EPISODES}]."
        )
    name = deployment.policy.environment
    environments = make_environments(name, 1, film=on_frame is not None)
    try:
        check_fit(deployment.policy, environments[0])
        environments += make_environments(name, episodes - 1)
        return _play(deployment, environments, max_steps, record, on_episode, on_frame)
    finally:
        close_environments(environments)


def _play(
    deployment: Deployment,
    environments: list[Environment],
    max_steps: int | None,
    record: Record | None,
    on_episode: Callable[[Episode], None],
    on_frame: Callable[[Frame, float], None] | None,
) -> RunResult:
    result = RunResult(deployment, reward_threshold(environments[0]), max_steps)

    def note(episode: Episode) -> None:
        result.episodes.append(episode)
        on_episode(episode)

    started = time.perf_counter()
    try:
        lockstep(
            deployment.act if record is None else partial(record.act, deployment.act),
            environments,
            deployment.seed,
            max_steps=max_steps,
            on_step=result.count_step,
            on_rewards=_drop if record is None else record.rewards,
            on_episode=note,
            on_frame=on_frame,
        )
    except KeyboardInterrupt:
        result.interrupted = True
    result.wall_seconds = time.perf_counter() - started
    result.episodes.sort(key=lambda episode: episode.seed)
    return result
