"""Stand-ins of wandb, mlflow and optuna, as far as docs/howto/callbacks.md calls them.

Written from their public documentation: the same names and arguments, and what each of them refuses
or drops.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any


@dataclass
class WandbRun:
    """wandb.Run: rows by their step. A row is written once a later step begins, and is fixed then;
    what comes for an earlier step is dropped with a warning, an error here."""

    project: str | None
    config: Mapping[str, Any]
    rows: dict[int, dict[str, Any]] = field(default_factory=dict)
    finished: bool = False

    def log(
        self, data: dict[str, Any], step: int | None = None, commit: bool | None = None
    ) -> None:
        assert isinstance(data, Mapping), "wandb.log must be passed a dictionary"
        assert all(isinstance(key, str) for key in data)
        assert isinstance(step, int), "steps are integers"
        assert step >= max(self.rows, default=0), "steps must be monotonically increasing"
        self.rows.setdefault(step, {}).update(data)

    def __enter__(self) -> WandbRun:
        return self

    def __exit__(self, *_: object) -> None:
        self.finished = True


class Wandb(ModuleType):
    def __init__(self) -> None:
        super().__init__("wandb")
        self.runs: list[WandbRun] = []

    def init(self, *, project: str | None = None, config: Any = None, **_: Any) -> WandbRun:
        self.runs.append(WandbRun(project, config or {}))
        return self.runs[-1]


class Mlflow(ModuleType):
    def __init__(self) -> None:
        super().__init__("mlflow")
        self.active = False
        self.params: dict[str, Any] = {}
        self.metrics: list[tuple[str, float, int]] = []

    @contextmanager
    def start_run(self, **_: Any) -> Iterator[None]:
        self.active = True
        yield
        self.active = False

    def log_params(self, params: dict[str, Any]) -> None:
        self.params |= params

    def log_metrics(
        self, metrics: dict[str, float], step: int | None = None, synchronous: bool | None = None
    ) -> None:
        assert self.active
        for name, value in metrics.items():
            assert re.fullmatch(r"[/\w.\- :]+", name), f"Invalid metric name: {name!r}"
            assert isinstance(step, int)
            self.metrics.append((name, float(value), step))


class TrialPruned(Exception):  # noqa: N818
    """optuna.TrialPruned: the study notes it and goes on."""


@dataclass
class Trial:
    number: int
    params: dict[str, float] = field(default_factory=dict)
    reported: dict[int, float] = field(default_factory=dict)
    value: float | None = None
    state: str = "RUNNING"

    def suggest_float(
        self, name: str, low: float, high: float, *, step: float | None = None, log: bool = False
    ) -> float:
        share = random.Random(self.number).random()
        chosen = low * (high / low) ** share if log else low + share * (high - low)
        return self.params.setdefault(name, chosen)

    def report(self, value: float, step: int) -> None:
        assert isinstance(step, int)
        assert step >= 0
        self.reported.setdefault(step, float(value))

    def should_prune(self) -> bool:
        """A pruner that gives up the third trial, once it has reported something."""
        return self.number == 2 and bool(self.reported)


class Study:
    def __init__(self, direction: str):
        self.direction = direction
        self.trials: list[Trial] = []

    def optimize(self, func: Callable[[Trial], float], n_trials: int | None = None) -> None:
        for number in range(n_trials or 0):
            trial = Trial(number)
            self.trials.append(trial)
            try:
                trial.value, trial.state = func(trial), "COMPLETE"
            except TrialPruned:
                trial.state = "PRUNED"

    @property
    def best_params(self) -> dict[str, float]:
        done = [trial for trial in self.trials if trial.value is not None]
        return max(done, key=lambda trial: trial.value or 0.0).params


class Optuna(ModuleType):
    TrialPruned = TrialPruned

    def __init__(self) -> None:
        super().__init__("optuna")
        self.studies: list[Study] = []

    def create_study(self, *, direction: str | None = None, **_: Any) -> Study:
        self.studies.append(Study(direction or "minimize"))
        return self.studies[-1]


def trackers() -> dict[str, ModuleType]:
    """The stand-ins by the names of their modules."""
    return {"wandb": Wandb(), "mlflow": Mlflow(), "optuna": Optuna()}
