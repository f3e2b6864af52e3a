"""How a policy is played: one frozen record that every player reads."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.calibration import Calibration
from qcompile.caller import option
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
    """Everything a run depends on besides policy, backend and number of episodes.

    Command line, Python, evaluation cells, journals and results use the same names and defaults.
    `resolved` fills in what depends on the backend.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    shots: int | None = 8192
    """Shots of each circuit for each row; None uses expectations without shot noise."""
    level: int = 2
    """Optimisation level of `qcompile.compile`."""
    mitigation: str | None = None
    """A name in MITIGATIONS. None means that of the calibration, `readout` if one must be measured,
    and `none` on a device without errors or with `predistort`."""
    calibration: Calibration | None = None
    """The calibration used for mitigation; None means the backend's, or one measured first."""
    calibration_file: str | None = None
    """The file of `calibration`, as named in results."""
    calibration_shots: int | Literal["auto"] = CALIBRATION_SHOTS
    """Shots of a calibration that is measured first; "auto" takes the fewest that suit the shots of
    a row (`mitigation.enough_shots`)."""
    predistort: bool = False
    """Adjust angles by the response curves so that the device shows the ideal `<Z>`."""
    greedy: bool = False
    """Take the most probable action instead of sampling one."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Episode i resets with seed + i; shots and actions are drawn from streams of the seed."""
    copies: int | None = None
    """Copies of the circuits side by side on the device, for episodes that share an execution; None
    means one, or with `split` as many as fit."""
    split: bool = False
    """Spread the shots of a row over the copies: fewer executions, and errors average out."""
    speculate: Speculate = 1
    """Decisions of each episode that a job measures, along predicted steps; "auto" chooses the most
    efficient number. It is one with exact expectations, where nothing is measured."""
    max_steps: int | None = None
    """Environment steps after which each episode is stopped; None plays it to its end."""

    @classmethod
    def of(cls, settings: RunSettings | None = None, **changes: Any) -> RunSettings:
        """`settings`, or the defaults, with `changes`.

        Raises:
            OptionError: a setting is unknown, or its value has the wrong type.
        """
        values = {} if settings is None else settings.values
        try:
            return cls(**(values | changes))
        except ValidationError as error:
            raise OptionError("These settings are not valid.", *explain(error)) from error

    @property
    def values(self) -> dict[str, Any]:
        """The settings as a dict by name."""
        return {name: getattr(self, name) for name in RunSettings.model_fields}

    @property
    def calibrates(self) -> bool:
        """Whether a calibration is used; valid only for resolved settings."""
        return self.predistort or self.mitigation != "none"

    @property
    def places(self) -> int:
        """The copies that share the shots of a row; valid only for fitted settings."""
        return (self.copies or 1) if self.split else 1

    @property
    def program_shots(self) -> int:
        """Shots of an execution of the program: those of the copy with the most."""
        return -(-(self.shots or 0) // self.places)

    @property
    def place_shots(self) -> CountArray:
        """The shots of a row in each copy, (places,); the first ones may have one more.

        Exact expectations have equal weight in all copies.
        """
        fewer, more = divmod(self.shots or self.places, self.places)
        return fewer + (np.arange(self.places) < more)

    @property
    def place_weights(self) -> FloatArray:
        """The share of a row's shots in each copy, (places,)."""
        shots = self.place_shots
        return np.asarray(shots / shots.sum())

    def circuit_shots(self, circuits: int) -> CircuitShots:
        """The shots of each circuit of the program, with `circuits` circuits in each copy."""
        if not self.split:
            return self.shots or 0
        return np.repeat(self.place_shots, circuits)

    def resolved(self, device: Device, known: Calibration | None = None) -> Self:
        """The settings for a backend with `device` and its own calibration `known`.

        Fills in everything except what depends on the circuits: see `fitted`.

        Raises:
            CalibrationError: the mitigation is unknown, or does not work at this level.
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
        """Check that each copy has an episode, or a share of the shots.

        Raises:
            OptionError: there are more copies than episodes.
        """
        if not self.split and self.copies is not None and self.copies > episodes:
            raise OptionError(
                f"{self.copies} copies are more than the {count(episodes, 'episode')} there are.",
                f"{option('split')} spreads the shots of an episode over copies.",
            )

    def fitted(self, fit: int) -> Self:
        """Resolved settings for circuits of which `fit` copies fit on the device.

        A split row uses all of them, as long as each gets a shot.

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
                "There is nothing to split over: the circuits fit on the device "
                f"{'once' if fit == 1 else f'{fit} times'}{shots}.",
                f"Remove {option('split')}; it is for devices with several times more qubits than "
                "circuits.",
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
                f"{option('predistort')} cannot be combined with {option('mitigation')} "
                f"{self.mitigation}.",
                "Predistorted angles make the device show the ideal <Z>: use "
                f"{option('mitigation')} none.",
            )
        if self.calibration is not None and not self.calibrates:
            raise OptionError(
                f"A calibration needs {option('mitigation')} readout or response, or "
                f"{option('predistort')}.",
                "Nothing else uses it.",
            )
        if self.predistort or self.mitigation == "response":
            # Refused before anything is measured.
            check_response_level(self.level, predistort=self.predistort)
        if self.copies is not None and self.copies < 1:
            raise CircuitError(
                f"{option('copies')} cannot be {self.copies}.", "It must be at least 1."
            )
        if self.speculate != "auto" and not 1 <= self.speculate <= MOST_AHEAD:
            raise OptionError(
                f"{option('speculate')} cannot be {self.speculate}.",
                f'It is a number of decisions from 1 to {MOST_AHEAD}, or "auto".',
            )
        if self.split:
            self._check_split()
        if self.calibration_shots != "auto":
            check_shots(self.calibration_shots)
        if self.max_steps is not None and self.max_steps < 1:
            raise CountsError(
                f"{option('max_steps')} cannot be {self.max_steps}.", "It must be at least 1."
            )

    def _check_split(self) -> None:
        if self.copies == 1:
            raise OptionError(
                f"{option('split')} spreads the shots of a row over several copies; "
                f"{option('copies')} is 1.",
                f"Set more copies, or remove {option('copies')} to use as many as fit.",
            )
        if self.copies is not None and self.shots is not None and self.copies > self.shots:
            raise OptionError(
                f"{self.shots} shots cannot be split over {self.copies} copies.",
                "Each copy needs a shot.",
            )
