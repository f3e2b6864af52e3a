"""How a policy is played: one frozen record, which everything that plays reads."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.calibration import Calibration
from qcompile.deploy.depth import Speculate
from qcompile.device import Device
from qcompile.errors import CalibrationError, CircuitError, CountsError, OptionError
from qcompile.execution import check_shots
from qcompile.limits import MOST_AHEAD
from qcompile.mitigation import CALIBRATION_SHOTS, check_response_level
from qcompile.notebook import count
from qcompile.validation import explain

MitigationName = Literal["none", "readout", "response"]
MITIGATIONS: tuple[str, ...] = get_args(MitigationName)


class RunSettings(BaseModel):
    """All that a run depends on besides its policy, its backend and its number of episodes.

    Command line, Python, cells of an evaluation, journals and results read the same names and
    defaults. `resolved` fills in what depends on the backend.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    shots: int | None = 8192
    """Shots of each circuit for each row; None takes expectations without shot noise."""
    level: int = 2
    """Optimisation level of `qcompile.compile`."""
    mitigation: str | None = None
    """A name of MITIGATIONS; None: that of the calibration, `readout` where one has to be measured,
    `none` on a device without errors or with `predistort`."""
    calibration: Calibration | None = None
    """What mitigates; None: that of the backend, or one measured first."""
    calibration_file: str | None = None
    """The file of `calibration`, as results name it."""
    calibration_shots: int | Literal["auto"] = CALIBRATION_SHOTS
    """Shots of a calibration that is measured first; "auto": as few as the shots of a row ask for
    (`mitigation.enough_shots`)."""
    predistort: bool = False
    """Change the angles by the response curves, so that the device shows the ideal `<Z>`."""
    greedy: bool = False
    """Take the most probable action instead of sampling one."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Episode i resets with seed + i; shots and actions are drawn from streams of the seed."""
    copies: int | None = None
    """Copies of the circuits side by side on the device, for episodes that share an execution;
    None: one, or with `split` as many as fit."""
    split: bool = False
    """Spread the shots of a row over the copies: its executions are fewer, and errors average."""
    speculate: Speculate = 1
    """Decisions of each episode that a job measures, along predicted steps; "auto": as many as pay.
    Where nothing is measured, with exact expectations, one."""
    max_steps: int | None = None
    """Environment steps after which each episode is stopped; None: play it to its end."""

    @classmethod
    def of(cls, settings: RunSettings | None = None, **changes: Any) -> RunSettings:
        """`settings`, or the defaults, with `changes`.

        Raises:
            OptionError: there is no such setting, or its value is of another type.
        """
        values = {} if settings is None else settings.values
        try:
            return cls(**(values | changes))
        except ValidationError as error:
            raise OptionError("These settings cannot be used.", *explain(error)) from error

    @property
    def values(self) -> dict[str, Any]:
        """The settings by name."""
        return {name: getattr(self, name) for name in RunSettings.model_fields}

    @property
    def calibrates(self) -> bool:
        """Whether a calibration is used; only for resolved settings."""
        return self.predistort or self.mitigation != "none"

    @property
    def places(self) -> int:
        """The copies that share the shots of a row; only for settings that are filled in."""
        return (self.copies or 1) if self.split else 1

    @property
    def program_shots(self) -> int:
        """Shots of an execution of the program for a row: those of the place with the most."""
        return -(-(self.shots or 0) // self.places)

    @property
    def place_shots(self) -> CountArray:
        """The shots of a row in each place, (places,): the first ones have one more.

        Exact expectations count alike in all places.
        """
        fewer, more = divmod(self.shots or self.places, self.places)
        return fewer + (np.arange(self.places) < more)

    @property
    def place_weights(self) -> FloatArray:
        """The share of a row's shots that each place has, (places,)."""
        shots = self.place_shots
        return np.asarray(shots / shots.sum())

    def circuit_shots(self, circuits: int) -> CircuitShots:
        """The shots of each circuit of the program, which has `circuits` in each place."""
        if not self.split:
            return self.shots or 0
        return np.repeat(self.place_shots, circuits)

    def resolved(self, device: Device, known: Calibration | None = None) -> Self:
        """The settings for a backend of `device` whose own calibration is `known`.

        All are filled in but what depends on the circuits: see `fitted`.

        Raises:
            CalibrationError: no such mitigation, or level and calibration do not go together.
            CircuitError: copies are out of range.
            CountsError: shots are out of range.
            OptionError: settings contradict each other.
        """
        known = self.calibration or known
        mitigation = self.mitigation
        if mitigation is None:
            measured = "readout" if known is None else known.mitigation
            mitigation = "none" if self.predistort or device.is_ideal else measured
        copies = 1 if self.copies is None and not self.split else self.copies
        settings = self.model_copy(
            update={
                "mitigation": mitigation,
                "copies": copies,
                "speculate": 1 if self.shots is None else self.speculate,
            }
        )
        settings._check()
        return settings

    def check_shared(self, episodes: int) -> None:
        """Nothing, if each copy has an episode, or a share of the shots.

        Raises:
            OptionError: there are more copies than episodes.
        """
        if not self.split and self.copies is not None and self.copies > episodes:
            raise OptionError(
                f"copies {self.copies} are more than the {count(episodes, 'episode')} there are "
                "to share an execution.",
                "--split spreads the shots of an episode over them.",
            )

    def fitted(self, fit: int) -> Self:
        """Resolved settings for circuits of which `fit` copies fit side by side on the device.

        A split row takes all of them, as long as each has a shot.

        Raises:
            OptionError: fewer than two fit.
        """
        if not self.split or self.copies is not None:
            return self
        copies = fit if self.shots is None else min(fit, self.shots)
        if copies < 2:
            shots = "" if self.shots is None else f", and a row has {self.shots} shots"
            shots = shots.removesuffix("s") if self.shots == 1 else shots
            raise OptionError(
                "There is nothing to split: the circuits fit on the device "
                f"{'once' if fit == 1 else f'{fit} times'}{shots}.",
                "Remove split; it is for devices with several times as many qubits as circuits.",
            )
        return self.model_copy(update={"copies": copies})

    def _check(self) -> None:
        if self.shots is not None:
            check_shots(self.shots)
        if self.mitigation not in MITIGATIONS:
            raise CalibrationError(
                f"Unknown mitigation {self.mitigation!r}.", f"Known: {', '.join(MITIGATIONS)}."
            )
        if self.predistort and self.mitigation != "none":
            raise OptionError(
                f"predistort and mitigation {self.mitigation} exclude each other.",
                "Predistorted angles make the device show the ideal <Z>: take mitigation none.",
            )
        if self.calibration is not None and not self.calibrates:
            raise OptionError(
                "A calibration needs mitigation readout or response, or predistort.",
                "Nothing else reads it.",
            )
        if self.predistort or self.mitigation == "response":
            # Refused before anything is measured.
            check_response_level(self.level, predistort=self.predistort)
        if self.copies is not None and self.copies < 1:
            raise CircuitError(
                f"{self.copies} copies of a program cannot be placed.", "One is the least."
            )
        if self.speculate != "auto" and not 1 <= self.speculate <= MOST_AHEAD:
            raise OptionError(
                f"speculate cannot be {self.speculate}.",
                f'It is a number of decisions from 1 to {MOST_AHEAD}, or "auto".',
            )
        if self.split:
            self._check_split()
        if self.calibration_shots != "auto":
            check_shots(self.calibration_shots)
        if self.max_steps is not None and self.max_steps < 1:
            raise CountsError(
                f"Episodes of {self.max_steps} steps cannot be played.", "One step is the least."
            )

    def _check_split(self) -> None:
        if self.copies == 1:
            raise OptionError(
                "split spreads the shots of a row over several copies, found one.",
                "Give more copies, or none: as many as fit.",
            )
        if self.copies is not None and self.shots is not None and self.copies > self.shots:
            raise OptionError(
                f"{self.shots} shots cannot be split over {self.copies} copies.",
                "Each of them needs a shot.",
            )
