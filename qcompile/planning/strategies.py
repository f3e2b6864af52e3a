"""The cost of a run with each strategy, before anything is sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from qcompile.deploy.play import play
from qcompile.deploy.result import Run
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device
from qcompile.execution import Backend, Executor, Workload
from qcompile.limits import FREE_SECONDS, USD_PER_SECOND
from qcompile.live.play import RunTask
from qcompile.mitigation import CALIBRATION_SHOTS, calibration_workload
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.passes import compile, copies_that_fit
from qcompile.policy import Policy
from qcompile.policy.files import policy_values

PAPER, PACKED = "as in the paper", "packed"
LOCKSTEP, TWIN = "packed, lockstep", "calibrate, play twin"


@dataclass(frozen=True)
class Strategy:
    """A strategy for running a policy, with its jobs and executions."""

    name: str
    load: Workload

    def values(self, usd_per_second: float = USD_PER_SECOND) -> dict[str, Any]:
        """The strategy as plain values, with seconds, price and share of the free plan."""
        seconds = self.load.qpu_seconds
        return {
            "name": self.name,
            "jobs": self.load.jobs,
            "executions": self.load.executions,
            "qpu_seconds": seconds,
            "price_usd": seconds * usd_per_second,
            "share_of_free_plan": seconds / FREE_SECONDS,
        }


def run_task(
    policy: Policy,
    device: Device,
    settings: RunSettings,
    episodes: int,
    *,
    backend: str,
    **where: Any,
) -> RunTask:
    """The task of a live run of the episodes on `backend`; `where` are fields on how it is sent.

    Without `copies` in the settings, as many episodes, or copies of a split row, as fit.

    Raises:
        OptionError: rows are to be split, but two copies do not fit.
    """
    task = RunTask.model_validate(
        {
            **settings.values,
            **where,
            "backend": backend,
            "device": device,
            "policy": policy_values(policy),
            "episodes": episodes,
            "copy_of": "episode",
        }
    )
    if task.copies is not None:
        return task
    fit = copies_that_fit(policy.program, device)
    copies = task.fitted(fit).places if task.split else min(episodes, fit)
    return task.model_copy(update={"copies": copies})


def forecast(task: RunTask, backend: Backend | Executor | None = None) -> Run:
    """Play the task on the backend, by default its device's noise model, from the same resets.

    Its `total_load` is the load of `run --live` if the episodes last as long on the machine.
    """
    return play(task.deploy(backend or task.device), task.episodes)


def strategies(task: RunTask, forecasted: Run) -> list[Strategy]:
    """The strategies for running the task, the paper's first, with the forecast episode lengths.

    All except the paper's and the twin's include the calibration of the task's mitigation.
    """
    policy, steps, shots = task.policy.policy(), forecasted.decisions, task.shots or 0
    executable = compile(policy.trained_program, task.device, task.level, policy.importance)
    alone = task.model_copy(update={"copies": 1, "split": False}).deploy(task.device)
    of_circuit = Workload.of_batch(1, 1, shots)
    of_step = Workload.of_batch(1, executable.round_count, shots)
    chosen = [
        Strategy(PAPER, of_circuit * (steps * len(policy.program))),
        Strategy(PACKED, of_step * steps + alone.calibration_load),
        Strategy(LOCKSTEP, forecasted.total_load),
    ]
    if task.level == 2 and not policy.program.has_products:  # a twin plays nothing else
        qubits, angles = len(np.unique(executable.qubits)), len(LIVE_ANGLES_RAD)
        of_twin = calibration_workload(qubits, CALIBRATION_SHOTS, ["response"], angles)
        chosen.append(Strategy(TWIN, of_twin))
    return chosen
