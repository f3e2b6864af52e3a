"""Play episodes with a policy on a backend, all in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.errors import CountsError
from qcompile.execution import Backend, open_executor, qpu_seconds
from qcompile.limits import MAX_EPISODES, MAX_EXECUTIONS_PER_JOB
from qcompile.policy import Policy
from qcompile.rl.environments import (
    Environment,
    check_fit,
    make_environments,
    reward_threshold,
)
from qcompile.rl.lockstep import Episode, Frame, lockstep
from qcompile.rl.measurement import Measurement

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

_LEAST_FOR_SOLVED = 100
_BLOCK = 1_000_000
_NO_THETA = np.zeros(0)


class Deployment:
    """A policy compiled for a device: from observations to actions.

    `shots` None takes expectations without shot noise. Shot noise, calibration and the sampling
    of actions draw from generators derived from `seed`, so a deployment repeats exactly. With
    `copies` so many episodes share an execution, their circuits side by side on the device.

    Raises:
        CalibrationError: `mitigation` is not one of MITIGATIONS, or a qubit cannot be calibrated.
        CircuitError: copies are out of range.
        CountsError: shots out of range.
    """

    def __init__(
        self,
        policy: Policy,
        backend: str | Device | Backend,
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
        self.calibration_executions = self._measure.calibration_executions
        self.executor, self.executable = self._measure.executor, self._measure.executable
        self.device = self.executor.device

    def expectation(self, observations: FloatArray) -> FloatArray:
        """<Z> of every circuit as measured and mitigated, (B, circuits)."""
        return self._measure(self.policy.encode(observations), _NO_THETA)

    def act(self, observations: FloatArray) -> IntArray:
        """An action for each of the observations (B, features)."""
        z = self.expectation(observations)
        return self.policy.greedy(z) if self.greedy else self.policy.sample(z, self._rng)


@dataclass
class RunResult:
    """What a run found; `episodes` are those that finished.

    `threshold` is the mean reward at which the environment counts as solved, if it has one;
    `steps` counts the steps of the lockstep, `env_steps` those of every environment, `programs`
    the programs bound for them: one for as many episodes as the deployment has copies.
    """

    deployment: Deployment
    threshold: float | None = None
    episodes: list[Episode] = field(default_factory=list)
    jobs: int = 0
    steps: int = 0
    env_steps: int = 0
    programs: int = 0
    wall_seconds: float = 0.0
    interrupted: bool = False

    def count_step(self, living: int) -> None:
        """Count a step of `living` episodes: one job, or more where a job cannot hold it."""
        self.steps += 1
        self.env_steps += living
        programs = -(-living // self.deployment.copies)
        self.programs += programs
        executions = programs * self._executions_per_program
        self.jobs += max(1, -(-executions // MAX_EXECUTIONS_PER_JOB))

    @property
    def _executions_per_program(self) -> int:
        return self.deployment.executable.round_count * (self.deployment.shots or 0)

    @property
    def rewards(self) -> FloatArray:
        return np.array([episode.reward for episode in self.episodes])

    @property
    def executions(self) -> int:
        """Circuits after packing times shots, those of the calibration included."""
        if self.deployment.shots is None:
            return 0
        calibration = self.deployment.calibration_executions
        return self.programs * self._executions_per_program + calibration

    def summary(self, calibration: str | None = None) -> dict[str, Any]:
        """The plain values of `qcompile run --json`; `calibration` is the name of its file."""
        made, rewards = self.deployment, self.rewards
        policy, counts = made.policy, made.executable.gate_counts()
        threshold = self.threshold
        mean = float(rewards.mean()) if len(rewards) else None
        judged = (
            threshold is not None
            and mean is not None
            and len(rewards) >= _LEAST_FOR_SOLVED
            and not self.interrupted  # the shortest episodes end first: their mean is biased
        )
        jobs = self.jobs + (made.calibration_executions > 0)
        return {
            "policy": policy.name,
            "environment": policy.environment,
            "backend": made.device.name,
            "kind": made.executor.kind,
            "shots": "exact" if made.shots is None else made.shots,
            "mitigation": made.mitigation,
            "predistort": made.predistort,
            "calibration": calibration,
            "copies": made.copies,
            "level": made.level,
            "greedy": made.greedy,
            "seed": made.seed,
            "episodes": [vars(episode) for episode in self.episodes],
            "mean_reward": mean,
            "std_reward": float(rewards.std()) if len(rewards) else None,
            "ci95": None if self.interrupted else bootstrap_ci95(rewards, made.seed),
            "solved": mean >= threshold if judged else None,  # type: ignore[operator]
            "gates_per_circuit": {
                gate: max((count[gate] for count in counts), default=0)
                for gate in ("sx", "rz", "x", "rx")
            },
            "circuits_per_step": len(policy.program),
            "rounds_per_step": made.executable.round_count,
            "executions": self.executions,
            "qpu_seconds_estimate": (
                None if made.shots is None else qpu_seconds(jobs, self.executions)
            ),
            "env_steps": self.env_steps,
            "wall_seconds": self.wall_seconds,
            "interrupted": self.interrupted,
        }


def bootstrap_ci95(rewards: FloatArray, seed: int, resamples: int = 10_000) -> list[float] | None:
    """The 95 % bootstrap interval [low, high] of the mean reward; None without episodes."""
    if not len(rewards):
        return None
    rng = np.random.default_rng(seed)
    blocks = np.array_split(np.empty(resamples), -(-resamples * len(rewards) // _BLOCK))
    means = [rng.choice(rewards, (len(block), len(rewards))).mean(axis=1) for block in blocks]
    return [float(v) for v in np.percentile(np.concatenate(means), [2.5, 97.5])]


def play(
    deployment: Deployment,
    episodes: int,
    *,
    on_episode: Callable[[Episode], None] = lambda episode: None,
    on_frame: Callable[[Frame, float], None] | None = None,
) -> RunResult:
    """Play `episodes` episodes in lockstep; episode i resets with the deployment's seed + i.

    All living episodes step together: one batch of circuits, one job. Ctrl-C ends the run and
    keeps what is finished. `on_frame` gets the frames of the first episode, (height, width, 3),
    and how many of them make a second.

    Raises:
        CountsError: episodes lie outside [1, MAX_EPISODES].
        EnvironmentMismatchError: the environment is unknown or does not fit the policy.
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
        return _play(deployment, environments, on_episode, on_frame)
    finally:
        for environment in environments:
            environment.close()


def _play(
    deployment: Deployment,
    environments: list[Environment],
    on_episode: Callable[[Episode], None],
    on_frame: Callable[[Frame, float], None] | None,
) -> RunResult:
    result = RunResult(deployment, reward_threshold(environments[0]))

    def note(episode: Episode) -> None:
        result.episodes.append(episode)
        on_episode(episode)

    started = time.perf_counter()
    try:
        lockstep(
            deployment.act,
            environments,
            deployment.seed,
            on_step=result.count_step,
            on_episode=note,
            on_frame=on_frame,
        )
    except KeyboardInterrupt:
        result.interrupted = True
    result.wall_seconds = time.perf_counter() - started
    result.episodes.sort(key=lambda episode: episode.seed)
    return result
