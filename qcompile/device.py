"""Devices: the qubits of a machine and their calibration, read from hardware/*.json."""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from qcompile.catalogue import find, names, nearest
from qcompile.errors import DeviceError
from qcompile.foreign import is_qiskit_backend
from qcompile.ir import COUPLINGS
from qcompile.native import SX, NativeGates
from qcompile.notebook import count, html_table
from qcompile.reading import ContentsError, check_json, read_file
from qcompile.validation import Line, Many, Record, explain

IDEAL_NAME = "ideal"
_FORMAT = "qcompile-device-"
CALIBRATION_MARK = b'"qcompile-calibration-'
"""A calibration file contains this text, a device file does not."""

Probability = Annotated[float, Field(ge=0, le=1)]
Kind = Literal["ideal", "noise-model", "measured-response", "hardware"]
"""What results were measured on, and so how much they prove."""

GateName = Annotated[str, Field(pattern=r"^\w+$", max_length=40)]
Natural = Annotated[int, Field(ge=0)]
Coordinate = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
CoherenceTime = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class GateCalibration(Record):
    """One gate on one qubit: its average gate error (1 - fidelity) and its length."""

    error: Probability
    length_ns: Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Qubit(Record):
    """One physical qubit. p10 = P(1 | 0) and p01 = P(0 | 1) are its readout errors.

    A gate without an entry in `gates` is noiseless, as the virtual rz is. An id without one takes
    the entry of sx: on IBM's machines the two have the same length and error.
    """

    t1_us: CoherenceTime
    t2_us: CoherenceTime
    p10: Probability
    p01: Probability
    readout_ns: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    gates: dict[GateName, GateCalibration] = Field(default_factory=dict)
    doubtful: Many[Line] = ()

    @property
    def contrast(self) -> float:
        """1 - p01 - p10: the fraction of `<Z>` that survives the readout."""
        return 1.0 - self.p01 - self.p10


class Coupling(GateCalibration):
    """A two-qubit gate on two qubits, (control, target): its average gate error and its length."""

    gate: Literal["cx", "cz", "ecr"]
    qubits: tuple[Natural, Natural]


class Device(Record):
    """A machine that runs circuits: its gates, its qubits and their couplings.

    `qubits` is empty for `ideal`, which has as many perfect qubits as a program needs, all of them
    coupled. No circuit is placed on a qubit in `left_out`. `positions` are where a map draws the
    qubits, to the right and downwards; without them it finds places. Files of format 1 have no
    couplings and no positions.
    """

    format: Literal["qcompile-device-1", "qcompile-device-2"] = "qcompile-device-1"
    name: Annotated[str, Field(pattern=r"^[\w.-]+$", max_length=100)]
    aliases: Many[Line] = ()
    source: Line
    calibrated: Line | None = None
    basis_gates: Many[GateName]
    notes: Many[Line] = ()
    qubits: Many[Qubit] = ()
    left_out: Many[int] = ()
    couplings: Annotated[Many[Coupling], Field(exclude_if=lambda couplings: not couplings)] = ()
    positions: Annotated[
        Many[tuple[Coordinate, Coordinate]], Field(exclude_if=lambda positions: not positions)
    ] = ()

    @model_validator(mode="after")
    def _check(self) -> Device:
        NativeGates.of(self.basis_gates)
        if bool(self.qubits) == (self.name == IDEAL_NAME):
            raise ValueError(f"only the device {IDEAL_NAME!r}, which is built in, has no qubits")
        missing = set(self.left_out) - set(range(len(self.qubits)))
        if missing:
            raise ValueError(f"left_out names qubit {min(missing)}, which the device does not have")
        if self.qubits and len(set(self.left_out)) == len(self.qubits):
            raise ValueError("left_out names every qubit; at least one must remain")
        if self.qubits:
            self._check_couplings()
        return self

    def _check_couplings(self) -> None:
        for coupling in self.couplings:
            first, second = coupling.qubits
            if max(first, second) >= len(self.qubits):
                raise ValueError(
                    f"a coupling names qubit {max(first, second)}, which the device does not have"
                )
            if first == second:
                raise ValueError(f"a coupling connects qubit {first} with itself")
        for name in ("couplings", "positions"):
            if getattr(self, name) and self.format == "qcompile-device-1":
                raise ValueError(f"{name} need the format qcompile-device-2")
        if self.positions and len(self.positions) != len(self.qubits):
            raise ValueError(
                f"there are {len(self.positions)} positions for {len(self.qubits)} qubits"
            )
        if len(self.coupling_calibrations) < len(self.couplings):
            raise ValueError("a coupling is listed twice")

    @property
    def is_ideal(self) -> bool:
        return not self.qubits

    @property
    def native(self) -> NativeGates:
        """The gates that circuits are compiled to."""
        return NativeGates.of(self.basis_gates)

    @property
    def coupling_gates(self) -> tuple[str, ...]:
        """The two-qubit gates that circuits are compiled to, the most frequent one first."""
        if self.is_ideal:
            return COUPLINGS
        counts = Counter(coupling.gate for coupling in self.couplings)
        return tuple(gate for gate, _ in counts.most_common())

    @cached_property
    def coupling_calibrations(self) -> dict[tuple[str, int, int], Coupling]:
        """The calibration of each coupling, by gate, control and target."""
        return {(each.gate, *each.qubits): each for each in self.couplings}

    def without_couplings(self) -> Device:
        """The device for circuits of one qubit, as files of format 1 describe it."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        none: dict[str, Any] = {"couplings": (), "positions": ()}
        return Device(**values | none | {"format": "qcompile-device-1"})

    def to_json(self) -> str:
        return self.model_dump_json(indent=1) + "\n"

    def __repr__(self) -> str:
        qubits = "perfect qubits" if self.is_ideal else count(len(self.qubits), "qubit")
        return f"Device({self.name}, {qubits}, {' '.join(self.basis_gates)})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        columns = ["qubit", "T1, us", "T2, us", "p10 %", "p01 %"]
        rows = []
        for number, qubit in enumerate(self.qubits):
            errors = (f"{100 * qubit.p10:.2f}", f"{100 * qubit.p01:.2f}")
            rows.append([str(number), f"{qubit.t1_us:.1f}", f"{qubit.t2_us:.1f}", *errors])
        return html_table(columns, rows, repr(self))


IDEAL = Device(
    name=IDEAL_NAME,
    source="as many perfect qubits as needed",
    basis_gates=SX.gates,
)


def device_names() -> list[str]:
    """The name of every known device, `ideal` first, without aliases."""
    return [
        IDEAL_NAME,
        *(known for known in names("hardware", [".json"]) if _is_device_file(known)),
    ]


def _is_device_file(name: str) -> bool:
    """Whether the file with that name is a device file: the folder may hold other files too."""
    path = find("hardware", name, [".json"]) if name != IDEAL_NAME else None
    try:
        text = b"" if path is None else read_file(path)
    except (OSError, ContentsError):
        return False
    # A calibration file contains its device.
    return _FORMAT.encode() in text and CALIBRATION_MARK not in text


def backend_path(backend: object) -> Path | None:
    """The file that a backend is read from; None for an object, or if there is none."""
    if not isinstance(backend, str | PathLike):
        return None
    return find("hardware", fspath(backend), [".json"])


def load_device(name: str | Path) -> Device:
    """The device with this name or alias, or from the file at this path.

    Raises:
        DeviceError: there is no such device (the message suggests similar names), or the file is
            invalid.
    """
    if is_qiskit_backend(name):
        raise DeviceError(
            "load_device takes a name or a file, found a Qiskit backend.",
            "Use load_backend(backend).device.",
        )
    name = str(name)
    if name == IDEAL_NAME:
        return IDEAL
    path = backend_path(name)
    if path is not None:
        return _read(path)
    for known in device_names()[1:]:
        other = find("hardware", known, [".json"])
        if other is not None and name in (device := _read(other)).aliases:
            return device
    snapshot = name.replace("ibm_", "fake_", 1)
    if name.startswith("ibm_") and snapshot in device_names():
        raise DeviceError(
            f"{name} is an IBM machine, and there is no device file for it here.",
            f"Use {snapshot}, IBM's snapshot of it, or --live to reach the machine itself.",
        )
    raise DeviceError(
        f"Unknown backend {name!r}.",
        nearest(name, device_names()),
        "A path to a device file works too; `qcompile backends` lists the known devices.",
    )


def _read(path: Path) -> Device:
    try:
        contents = read_file(path)
        if CALIBRATION_MARK in contents:
            raise DeviceError(
                f"{path} is a calibration, not a device file.",
                "Pass it as --backend to `run`, `evaluate`, `calibrate`, `show`, `export` or "
                "`compile`.",
            )
        device = Device.model_validate_json(check_json(contents), strict=True)
    except (OSError, ContentsError, ValidationError) as error:
        raise DeviceError(f"{path} is not a device file.", *explain(error)) from error
    if device.is_ideal:
        raise DeviceError(
            f"{path} is not a device file.", f"The device {IDEAL_NAME!r} is built in."
        )
    return device
