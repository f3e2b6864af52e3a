"""The schema of a finished run's result in its journal, for each kind of run."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from qcompile.calibration import Calibration
from qcompile.live.journal import TaskKind
from qcompile.validation import Finite, Line

Count = Annotated[int, Field(ge=0)]


class _Figures(BaseModel):
    """Values that are read back; a later version may add more."""

    model_config = ConfigDict(extra="allow", frozen=True)


class EpisodeFigures(_Figures):
    reward: Finite


class RunFigures(_Figures):
    """The values of `deploy.result.Run.summary`."""

    policy: Line
    environment: Line
    environment_kwargs: dict[Line, Any] = {}
    backend: Line
    kind: Line
    shots: Count | Line
    mitigation: Line
    predistort: bool
    calibration: Line | None
    copies: Count
    split: bool = False
    calibration_shots: Count | None = None
    level: Count
    greedy: bool
    seed: int
    episodes: list[EpisodeFigures]
    mean_reward: Finite | None
    std_reward: Finite | None
    ci95: tuple[Finite, Finite] | None
    solved: bool | None
    gates_per_circuit: dict[Line, Count]
    couplings_per_circuit: Count = 0
    circuits_per_step: Count
    observables_per_step: Count | None = None
    rounds_per_step: Count
    max_steps: Count | None
    cut_episodes: Count | None = None
    mean_reward_completed: Finite | None = None
    ci95_completed: tuple[Finite, Finite] | None = None
    jobs: Count
    executions: Count
    hold: Annotated[int, Field(ge=1)] = 1
    speculate: Annotated[int, Field(ge=1)] | Literal["auto"] = 1
    measured_rows: Count | None = None
    decisions: Count | None = None
    env_steps: Count
    wall_seconds: Finite

    @model_validator(mode="after")
    def _check(self) -> RunFigures:
        if self.episodes and None in (self.mean_reward, self.std_reward):
            raise ValueError("episodes without a mean")
        if self.hold > 1 and self.decisions is None:
            raise ValueError("held decisions without their count")
        if self.speculate != 1 and None in (self.decisions, self.measured_rows):
            raise ValueError("decisions measured ahead without their count")
        return self


class CalibrateFigures(_Figures):
    calibration: Calibration


class ValidateFigures(_Figures):
    """The values of `TwinCheck.values` and the file; lists have an entry per qubit."""

    passed: bool
    failed: list[Count]
    qubits: list[Count]
    chi_square: list[Finite]
    degrees: list[Count]
    p_value: list[Finite]
    largest_difference: Finite
    file: Line
    shots: Count

    @model_validator(mode="after")
    def _check(self) -> ValidateFigures:
        columns = (self.qubits, self.chi_square, self.degrees, self.p_value)
        if len({len(column) for column in columns}) > 1:
            raise ValueError("lists of different lengths")
        return self


class SamplerFigures(_Figures):
    jobs_done: Count
    jobs_open: Count


_FIGURES: dict[TaskKind, type[_Figures]] = {
    "run": RunFigures,
    "calibrate": CalibrateFigures,
    "validate": ValidateFigures,
    "sampler": SamplerFigures,
}


def check_result(kind: TaskKind, result: dict[str, Any]) -> None:
    """Check that `result` is a possible result of a run of this kind.

    Raises:
        ValueError: it is not, or it holds a value that JSON cannot represent.
    """
    _FIGURES[kind].model_validate(result)
    try:
        json.dumps(result, allow_nan=False)
    except ValueError as error:
        raise ValueError("a number in it is not finite") from error
