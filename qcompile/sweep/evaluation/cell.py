"""Play one cell, and the schema of its file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from qcompile.deploy.environments import threshold_of
from qcompile.deploy.intervals import bootstrap_ci95
from qcompile.deploy.play import play, player
from qcompile.deploy.player import Player
from qcompile.deploy.result import is_solved
from qcompile.errors import CalibrationError, QcompileError
from qcompile.execution import Kind
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation.grid import Cell
from qcompile.sweep.folder import Folder
from qcompile.version import versions

Whole = Annotated[int, Field(ge=0)]
Amount = Annotated[float, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class _Episode(_Part):
    seed: Whole
    reward: float
    length: Annotated[int, Field(ge=1)]


class _Misfit(_Part):
    qubit: Whole
    part: Literal["readout", "response"]
    chi_square: Amount
    degrees: Whole
    p_value: Amount


class _Summary(_Part):
    """The object of `qcompile run --json` for a cell; old files lack the keys with a default."""

    policy: str
    environment: str
    environment_kwargs: dict[str, Any] = {}
    backend: str
    kind: Kind
    shots: int | Literal["exact"]
    mitigation: str
    predistort: Literal[False]
    calibration: str | None
    calibration_misfits: list[_Misfit] = []
    copies: Literal[1]
    split: Literal[False] = False
    calibration_shots: Whole | None = None
    level: int
    greedy: bool
    seed: int
    episodes: Annotated[list[_Episode], Field(min_length=1)]
    mean_reward: float
    std_reward: float
    ci95: Annotated[list[float], Field(min_length=2, max_length=2)] | None
    solved: bool | None
    gates_per_circuit: dict[str, Whole]
    couplings_per_circuit: Whole = 0
    circuits_per_step: Whole
    observables_per_step: Whole | None = None
    rounds_per_step: Whole
    max_steps: None = None
    cut_episodes: Literal[0] = 0
    mean_reward_completed: None = None
    ci95_completed: None = None
    jobs: Whole = 0
    executions: Whole
    qpu_seconds_estimate: Amount | None
    hold: Annotated[int, Field(ge=1)] = 1
    speculate: Literal[1] = 1
    measured_rows: Whole | None = None
    decisions: Whole | None = None
    env_steps: Whole
    wall_seconds: Amount
    interrupted: Literal[False]


class CellResult(BaseModel):
    """The result of a cell; `summary` is the object of `qcompile run --json`.

    `settings` are those of the cell; `threshold` is the mean reward at which its environment counts
    as solved, if it has one.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    format: Literal["qcompile-evaluation-1"] = "qcompile-evaluation-1"
    name: str
    settings: dict[str, Any]
    versions: dict[str, str]
    threshold: float | None
    summary: dict[str, Any]

    @field_validator("summary")
    @classmethod
    def _check_summary(cls, summary: dict[str, Any]) -> dict[str, Any]:
        _Summary.model_validate(summary)
        return summary

    @property
    def rewards(self) -> dict[int, float]:
        """The reward of each episode, by the seed of its reset."""
        return {episode["seed"]: episode["reward"] for episode in self.summary["episodes"]}


def deploy(cell: Cell) -> Player:
    """Open what plays the cell's policy on its backend.

    Raises:
        QcompileError: the policy does not fit the device, or a qubit cannot be calibrated.
    """
    file = cell.calibration
    return player(
        cell.policy,
        cell.backend,
        shots=cell.shots,
        level=cell.level,
        mitigation=cell.mitigation,
        calibration=None if file is None else file.calibration,
        calibration_file=None if file is None else file.name,
        greedy=cell.greedy,
        seed=cell.seed,
    )


def check_calibrations(cells: Sequence[Cell]) -> None:
    """Check that every calibration already at hand has what its cells need.

    Raises:
        CalibrationError: one lacks a part or a qubit; the message names it.
    """
    known = {
        (cell.policy, cell.backend, cell.mitigation, cell.level): cell
        for cell in cells
        if cell.mitigation != "none" and (cell.calibration or cell.backend.calibration)
    }
    for cell in known.values():
        try:
            deploy(cell)
        except CalibrationError as error:
            file = cell.calibration.name if cell.calibration else cell.backend.name
            raise CalibrationError(
                f"{file} cannot mitigate {cell.policy.name} on {cell.backend.name} "
                f"({cell.mitigation}):",
                *(line.strip() for line in str(error).splitlines()),
            ) from error


def run_cell(cell: Cell) -> CellResult | CellFailure:
    """Play the cell's episodes in lockstep.

    Raises:
        KeyboardInterrupt: Ctrl-C; an unfinished cell is not a result.
    """
    try:
        result = play(deploy(cell), cell.episodes)
    except QcompileError as error:
        return CellFailure(cell.name, str(error))
    if result.interrupted:
        raise KeyboardInterrupt
    return CellResult(
        name=cell.name,
        settings=cell.settings(),
        versions=versions("numpy", "gymnasium", *cell.backend.packages),
        threshold=result.threshold,
        summary=result.summary(),
    )


def folder_of(path: Path) -> Folder[Cell, CellResult]:
    """The cells of an evaluation in `path`.

    A file whose figures do not follow from its episodes is damaged and counts as missing. The
    interval is computed again, because earlier versions used another one.
    """
    return Folder(path, CellResult, _match)


def _match(cell: Cell, result: CellResult) -> CellResult | None:
    """The result, if its settings, policy and backend are those of the cell."""
    same = (result.name, result.settings) == (cell.name, cell.settings())
    if not same or not _is_consistent(result, cell):
        return None
    rewards = np.array([*result.rewards.values()])
    interval = {"ci95": bootstrap_ci95(rewards, cell.seed)}
    return result.model_copy(update={"summary": result.summary | interval})


def _is_consistent(result: CellResult, cell: Cell) -> bool:
    """Whether the summary belongs to this cell, and its figures follow from its episodes."""
    summary, hold = result.summary, cell.policy.hold
    episodes, rewards = summary["episodes"], np.array([*result.rewards.values()])
    expected = {
        "policy": cell.policy.name,
        "environment": cell.policy.environment,
        "backend": cell.backend.device.name,
        "shots": "exact" if cell.shots is None else cell.shots,
        "mitigation": cell.mitigation,
        "level": cell.level,
        "greedy": cell.greedy,
        "seed": cell.seed,
        "solved": is_solved(rewards, result.threshold),
        "env_steps": sum(episode["length"] for episode in episodes),
    }
    if hold > 1 or "decisions" in summary:  # earlier versions neither held nor wrote this
        expected["hold"] = hold
        expected["decisions"] = sum(-(-episode["length"] // hold) for episode in episodes)
    policy = cell.policy
    if (
        any(summary.get(key) != value for key, value in expected.items())
        or [episode["seed"] for episode in episodes]
        != [cell.seed + i for i in range(cell.episodes)]
        or result.threshold != threshold_of(policy.environment, policy.environment_kwargs)
    ):
        return False
    figures = [summary["mean_reward"], summary["std_reward"]]
    return np.allclose(figures, [rewards.mean(), rewards.std()], rtol=1e-9, atol=1e-9)
