"""Devices: the qubits of a machine and their calibration, read from hardware/*.json."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from qcompile.catalogue import find, names, nearest
from qcompile.errors import DeviceError
from qcompile.validation import Line, explain

IDEAL_NAME = "ideal"
LEAST_CONTRAST = 0.8
"""A qubit whose readout leaves less of <Z> is not used as long as there are others."""
_FORMAT = "qcompile-device-1"

Probability = Annotated[float, Field(ge=0, le=1)]
GateName = Annotated[str, Field(pattern=r"^\w+$", max_length=40)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class GateCalibration(_Record):
    """One gate on one qubit: its average gate error (1 - fidelity) and its length."""

    error: Probability
    length_ns: Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Qubit(_Record):
    """One physical qubit. p10 = P(1 | 0) and p01 = P(0 | 1) are its readout errors.

    A gate without an entry in `gates` is free of noise, as the virtual rz is.
    """

    t1_us: Positive
    t2_us: Positive
    p10: Probability
    p01: Probability
    readout_ns: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    gates: dict[GateName, GateCalibration] = {}
    doubtful: tuple[Line, ...] = ()

    @property
    def contrast(self) -> float:
        """1 - p01 - p10: how much of <Z> is left after the readout."""
        return 1.0 - self.p01 - self.p10


def relaxation(qubit: Qubit, length_ns: float) -> tuple[float, float]:
    """What thermal relaxation over `length_ns` leaves of r_z and of r_x, r_y.

    T2 is cut to 2 T1, the physical limit.
    """
    t1_ns = 1e3 * qubit.t1_us
    t2_ns = min(1e3 * qubit.t2_us, 2 * t1_ns)
    return math.exp(-length_ns / t1_ns), math.exp(-length_ns / t2_ns)


def relaxation_error(qubit: Qubit, length_ns: float) -> float:
    """The average gate error, 1 - fidelity, of thermal relaxation alone."""
    along, across = relaxation(qubit, length_ns)
    return (3 - along - 2 * across) / 6


class Device(_Record):
    """A machine that runs circuits: its gates and its qubits.

    `qubits` is empty for `ideal`, which has as many perfect qubits as a program needs.
    """

    format: Literal["qcompile-device-1"] = "qcompile-device-1"
    name: Annotated[str, Field(pattern=r"^[\w.-]+$")]
    aliases: tuple[Line, ...] = ()
    source: Line
    calibrated: Line | None = None
    basis_gates: tuple[GateName, ...]
    notes: tuple[Line, ...] = ()
    qubits: tuple[Qubit, ...] = ()
    left_out: tuple[int, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> Device:
        gates = set(self.basis_gates)
        if not (gates >= {"rz", "rx"} or gates >= {"rz", "sx", "x"}):
            raise ValueError(f"basis_gates holds {sorted(gates)}; it needs rz, sx, x or rz, rx")
        if bool(self.qubits) == (self.name == IDEAL_NAME):
            raise ValueError(f"only the device {IDEAL_NAME!r}, which is built in, has no qubits")
        return self

    @property
    def is_ideal(self) -> bool:
        return not self.qubits

    @cached_property
    def usable(self) -> tuple[int, ...]:
        """The qubits worth using, the best readout first.

        Left out are those that keep less than LEAST_CONTRAST of <Z>; if none keeps as much, the
        best one is used alone.
        """
        ranked = sorted(range(len(self.qubits)), key=lambda q: (-self.qubits[q].contrast, q))
        good = [q for q in ranked if self.qubits[q].contrast >= LEAST_CONTRAST]
        return tuple(good or ranked[:1])

    def to_json(self) -> str:
        return self.model_dump_json(indent=1) + "\n"


IDEAL = Device(
    name=IDEAL_NAME,
    source="as many perfect qubits as needed",
    basis_gates=("rz", "sx", "x"),
)


def device_names() -> list[str]:
    """Every device known by name, `ideal` first; aliases are left out."""
    return [IDEAL_NAME, *(known for known in names("hardware", [".json"]) if _claims(known))]


def _claims(name: str) -> bool:
    """Whether the file of that name says that it is a device: others may share the folder."""
    path = find("hardware", name, [".json"]) if name != IDEAL_NAME else None
    return path is not None and _FORMAT.encode() in path.read_bytes()


def load_device(name: str | Path) -> Device:
    """The device with this name or alias, or of the file at this path.

    Raises:
        DeviceError: no such device (the message has the nearest names), or a wrong file.
    """
    name = str(name)
    if name == IDEAL_NAME:
        return IDEAL
    path = find("hardware", name, [".json"])
    if path is not None:
        return _read(path)
    for known in device_names()[1:]:
        other = find("hardware", known, [".json"])
        if other is not None and name in (device := _read(other)).aliases:
            return device
    raise DeviceError(
        f"Unknown backend {name!r}.",
        nearest(name, device_names()),
        "A path to a device file works too; `qcompile backends` lists what is there.",
    )


def _read(path: Path) -> Device:
    try:
        device = Device.model_validate_json(path.read_bytes(), strict=True)
    except (OSError, ValidationError) as error:
        raise DeviceError(f"{path} is no device file.", *explain(error)) from error
    if device.is_ideal:
        raise DeviceError(f"{path} is no device file.", f"The device {IDEAL_NAME!r} is built in.")
    return device
