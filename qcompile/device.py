"""Devices: the qubits of a machine and their calibration, read from hardware/*.json."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from qcompile.catalogue import find, names, nearest
from qcompile.errors import DeviceError
from qcompile.foreign import is_qiskit_backend
from qcompile.reading import ContentsError, check_json, read_file
from qcompile.validation import Line, Many, explain

IDEAL_NAME = "ideal"
LEAST_CONTRAST = 0.8
"""A qubit whose pulses and readout leave less of `<Z>` is not used as long as there are others."""
REFERENCE_SHOTS = 1024
"""The shots for which the error of a qubit is stated, and by which qubits are ranked."""
_FORMAT = "qcompile-device-1"
_CALIBRATION = b'"qcompile-calibration-'

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

    A gate without an entry in `gates` is free of noise, as the virtual rz is. An id without one has
    that of sx: on IBM's machines both take as long and have one error.
    """

    t1_us: Positive
    t2_us: Positive
    p10: Probability
    p01: Probability
    readout_ns: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    gates: dict[GateName, GateCalibration] = {}
    doubtful: Many[Line] = ()

    @property
    def contrast(self) -> float:
        """1 - p01 - p10: how much of `<Z>` is left after the readout."""
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


def depolarising(calibration: GateCalibration, qubit: Qubit) -> float:
    """The depolarising probability that brings relaxation up to the gate error of a calibration.

    It is 0 where relaxation alone is worse than the stated error, and at most 4/3.
    """
    relaxed = relaxation_error(qubit, calibration.length_ns)
    error = min(calibration.error, 2 / 3)
    if error <= relaxed:
        return 0.0
    if relaxed >= 0.5:  # nothing but |0> is left, whatever comes before
        return 1.0
    return min(2 * (error - relaxed) / (1 - 2 * relaxed), 4 / 3)


def left_after(gate: str, qubit: Qubit) -> tuple[float, float, float]:
    """What the noise after `gate` leaves of r_x and r_y, of r_z, and what it adds to r_z."""
    calibration = qubit.gates.get(gate)
    if calibration is None and gate == "id":
        calibration = qubit.gates.get("sx")
    if calibration is None:
        return 1.0, 1.0, 0.0
    along, across = relaxation(qubit, calibration.length_ns)
    kept = 1 - depolarising(calibration, qubit)
    return kept * across, kept * along, 1 - along  # relaxation goes towards |0>


class Device(_Record):
    """A machine that runs circuits: its gates and its qubits.

    `qubits` is empty for `ideal`, which has as many perfect qubits as a program needs; those in
    `left_out` are never chosen for a circuit.
    """

    format: Literal["qcompile-device-1"] = "qcompile-device-1"
    name: Annotated[str, Field(pattern=r"^[\w.-]+$", max_length=100)]
    aliases: Many[Line] = ()
    source: Line
    calibrated: Line | None = None
    basis_gates: Many[GateName]
    notes: Many[Line] = ()
    qubits: Many[Qubit] = ()
    left_out: Many[int] = ()

    @model_validator(mode="after")
    def _check(self) -> Device:
        gates = set(self.basis_gates)
        if not (gates >= {"rz", "rx"} or gates >= {"rz", "sx", "x"}):
            raise ValueError(f"basis_gates holds {sorted(gates)}; it needs rz, sx, x or rz, rx")
        if bool(self.qubits) == (self.name == IDEAL_NAME):
            raise ValueError(f"only the device {IDEAL_NAME!r}, which is built in, has no qubits")
        missing = set(self.left_out) - set(range(len(self.qubits)))
        if missing:
            raise ValueError(f"left_out names qubit {min(missing)}, which the device does not have")
        if self.qubits and len(set(self.left_out)) == len(self.qubits):
            raise ValueError("left_out names every qubit; one at least has to stay")
        return self

    @property
    def is_ideal(self) -> bool:
        return not self.qubits

    @cached_property
    def usable(self) -> tuple[int, ...]:
        """The qubits worth using, the one with the least `mean_square_error` first."""
        left = [q for q in range(len(self.qubits)) if q not in self.unusable]
        return tuple(sorted(left, key=self.mean_square_error))

    @cached_property
    def unusable(self) -> dict[int, str]:
        """The qubits that are not used, each with the reason in words.

        They are those of `left_out`, and those that keep less than LEAST_CONTRAST of `<Z>`. If none
        keeps as much, those whose 0 and 1 are swapped and that keep as much otherwise are used,
        which need mitigation; if there are none of them, the best alone.
        """
        reasons = dict.fromkeys(sorted(set(self.left_out)), "is in left_out")
        rest = [q for q in range(len(self.qubits)) if q not in reasons]
        weak = [q for q in rest if self._kept(q) < LEAST_CONTRAST]
        if weak == rest:
            weak = [q for q in rest if abs(self._kept(q)) < LEAST_CONTRAST]
        if weak == rest and rest:
            weak.remove(min(rest, key=self.mean_square_error))
        reasons |= {q: f"keeps {self._kept(q):.2f} of <Z>" for q in weak}
        return dict(sorted(reasons.items()))

    def expected_error(self, qubit: int) -> float | None:
        """The root of `mean_square_error`, in units of `<Z>`; None where it is infinite."""
        error = self.mean_square_error(qubit)
        return math.sqrt(error) if math.isfinite(error) else None

    def mean_square_error(self, qubit: int) -> float:
        """The expected square of the error of `<Z>` on `qubit` with readout mitigation.

        It is that of a circuit at level 2, sx rz sx (or rx), at REFERENCE_SHOTS, averaged over
        `<Z>` in [-1, 1]. The measured `<Z>` is b + k `<Z>`, by the pulses and the readout; readout
        mitigation takes it for h + g `<Z>`, the line through |0> and |1> as they are measured, and
        undoes that. What remains is shot noise, 1 / g^2 of it, and what the pulses do beyond the
        calibration:

            (1 - b^2 - k^2 / 3) / (shots g^2)  +  ((b - h) / g)^2  +  (k / g - 1)^2 / 3

        It is infinite where g is 0; where 0 and 1 are swapped, g is negative and undoes that too.
        The clipping to [-1, 1] is not counted.
        """
        record = self.qubits[qubit]
        shift, contrast = record.p01 - record.p10, record.contrast
        slope, added = self._pulses(record)
        b, k = shift + contrast * added, contrast * slope
        _, along, added = left_after("rx" if self._has_rx else "x", record)
        one = added - along  # r_z of |1> as the calibration prepares it
        h, g = shift + contrast * (1 + one) / 2, contrast * (1 - one) / 2
        if g == 0:
            return math.inf
        variance = (1 - b**2 - k**2 / 3) / (REFERENCE_SHOTS * g**2)
        return variance + ((b - h) / g) ** 2 + (k / g - 1) ** 2 / 3

    def _kept(self, qubit: int) -> float:
        """How much of `<Z>` the pulses of a circuit and the readout leave."""
        return self.qubits[qubit].contrast * self._pulses(self.qubits[qubit])[0]

    def _pulses(self, qubit: Qubit) -> tuple[float, float]:
        """What sx rz sx, or rx, leaves of r_z, and what it adds to it."""
        if self._has_rx:
            _, along, added = left_after("rx", qubit)
            return along, added
        # Between the pulses the vector lies across; what the first adds along z, the second turns
        # to y, where it is not seen.
        across, along, added = left_after("sx", qubit)
        return across * along, added

    @property
    def _has_rx(self) -> bool:
        return "rx" in self.basis_gates

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
    try:
        text = b"" if path is None else read_file(path)
    except (OSError, ContentsError):
        return False
    return _FORMAT.encode() in text and _CALIBRATION not in text  # calibrations hold their device


def load_device(name: str | Path) -> Device:
    """The device with this name or alias, or of the file at this path.

    Raises:
        DeviceError: no such device (the message has the nearest names), or a wrong file.
    """
    if is_qiskit_backend(name):
        raise DeviceError(
            "load_device takes a name or a file, found a Qiskit backend.",
            "load_backend(backend).device is its calibration as a device.",
        )
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
        contents = read_file(path)
        if _CALIBRATION in contents:
            raise DeviceError(
                f"{path} is a calibration, no device file.",
                "It is a --backend of `run`, `evaluate`, `calibrate`, `show`, `export`, `compile`.",
            )
        device = Device.model_validate_json(check_json(contents), strict=True)
    except (OSError, ContentsError, ValidationError) as error:
        raise DeviceError(f"{path} is no device file.", *explain(error)) from error
    if device.is_ideal:
        raise DeviceError(f"{path} is no device file.", f"The device {IDEAL_NAME!r} is built in.")
    return device
