"""The calibrations of a grid, and the backends that each mitigates."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property

from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """A calibration, and the name of its file, which results use."""

    name: str
    calibration: Calibration

    @property
    def device_name(self) -> str:
        return self.calibration.backend

    @cached_property
    def contents(self) -> str:
        return self.calibration.model_dump_json()


def by_device(files: Sequence[CalibrationFile]) -> dict[str, CalibrationFile]:
    """The files by the name of the device that they were measured on.

    Raises:
        CalibrationError: two are of the same device.
    """
    by_name: dict[str, CalibrationFile] = {}
    for file in files:
        first = by_name.setdefault(file.device_name, file)
        if first is not file:
            raise CalibrationError(
                f"{first.name} and {file.name} are both of {file.device_name}.",
                "A grid takes one calibration per device: evaluate them one after the other.",
            )
    return by_name


def check_needed(files: Sequence[CalibrationFile], played: Set[str], mitigated: Set[str]) -> None:
    """Check that each of `files` mitigates something.

    `played` are the names of the devices of a grid, `mitigated` those with a mitigation.

    Raises:
        CalibrationError: a file mitigates nothing; the message says why.
    """
    for file in files:
        if file.device_name not in played:
            raise CalibrationError(
                f"{file.name} is of {file.device_name}, which is not in this grid.",
                f"Devices of this grid: {', '.join(sorted(played))}.",
                f"Remove it, or add {option('backend')} {file.device_name}.",
            )
        if file.device_name not in mitigated:
            raise CalibrationError(
                f"{file.name} is not needed: nothing on {file.device_name} is mitigated.",
                f"Remove it, or add {option('mitigation')} readout or response.",
            )
