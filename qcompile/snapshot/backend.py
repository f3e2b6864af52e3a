"""Snapshots: the calibration of a Qiskit backend, fake or live, as a Device."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from importlib import metadata
from typing import Any

from pydantic import ValidationError

from qcompile.catalogue import nearest
from qcompile.device import Device, GateCalibration, Qubit
from qcompile.errors import DeviceError, MissingExtraError
from qcompile.native import NativeGates
from qcompile.snapshot.couplings import (
    couplings_of_properties,
    couplings_of_target,
    positions_of,
)
from qcompile.snapshot.doubts import implausible_values, notes_on
from qcompile.validation import explain

QISKIT_PREFIX = "qiskit:"
_KNOWN_GATES = ("rz", "sx", "x", "rx")
_QUBIT_UNITS_NS = {
    "T1": 1e3,
    "T2": 1e3,
    "prob_meas1_prep0": None,
    "prob_meas0_prep1": None,
    "readout_length": 1.0,
}
_GATE_UNITS_NS = {"gate_error": None, "gate_length": 1.0}
_NS = {"ns": 1.0, "us": 1e3, "µs": 1e3, "ms": 1e6, "s": 1e9}


def find_backend(name: str) -> Any:
    """A new fake backend of qiskit-ibm-runtime, by class or backend name.

    `FakeLimaV2`, `fake_lima` and `qiskit:FakeLimaV2` name the same one.

    Raises:
        DeviceError: there is no such fake backend; the message suggests similar names.
        MissingExtraError: qiskit-ibm-runtime is not installed.
    """
    try:
        from qiskit_ibm_runtime import fake_provider
        from qiskit_ibm_runtime.fake_provider.fake_backend import FakeBackendV2
    except ImportError as error:
        raise MissingExtraError("A snapshot of a Qiskit backend", "qiskit") from error
    known: dict[str, type[Any]] = {}
    for member in vars(fake_provider).values():
        if isinstance(member, type) and issubclass(member, FakeBackendV2):
            known[member.__name__] = member
            if backend_name := getattr(member, "backend_name", None):
                known[backend_name] = member
    name = name.removeprefix(QISKIT_PREFIX)
    if name not in known:
        same_style = sorted(word for word in known if word.islower() == name.islower())
        raise DeviceError(f"Unknown fake backend {name!r}.", nearest(name, same_style))
    return known[name]()


def properties_of(backend: Any) -> Any:
    """`backend.properties()`; None if there are none, or they contain neither T1 nor T2.

    The properties of `AerSimulator.from_backend` lack them: its target holds T1 and T2.
    """
    properties = getattr(backend, "properties", None)
    properties = properties() if callable(properties) else properties
    if properties is None:
        return None
    names = {value.name for qubit in properties.qubits for value in qubit}
    return None if names.isdisjoint(("T1", "T2")) else properties


def device_name(backend: Any) -> str:
    """The name of a Qiskit backend, with characters that a device name may not have as `_`."""
    name = getattr(backend, "name", None) or type(backend).__name__
    return re.sub(r"[^\w.-]+", "_", str(name)).strip("_")[:100] or "backend"


def device_from_backend(backend: Any, name: str | None = None) -> Device:
    """A Device called `name` with the present calibration of a Qiskit BackendV2.

    Without a name it is called `device_name(backend)`. Values come from `properties_of`, or from
    `backend.target` if there are none; a target has one readout error for both states. Values that
    look wrong are kept and flagged in `Qubit.doubtful` and `Device.notes`. Qubits that IBM marks as
    faulty, or that have a missing or an impossible value, are in `Device.left_out`.

    Raises:
        DeviceError: the gates or a unit are not supported, or no qubit has all its values.
    """
    name = device_name(backend) if name is None else name
    properties = properties_of(backend)
    basis = tuple(gate for gate in _KNOWN_GATES if gate in backend.operation_names)
    try:
        NativeGates.of(basis)
    except ValueError as error:
        raise DeviceError(
            f"{type(backend).__name__} has the gates {', '.join(sorted(backend.operation_names))}.",
            "qcompile needs rz, sx and x, or rz and rx.",
        ) from error
    notes: tuple[str, ...] = ()
    if properties is not None:
        calibrations = _of_properties(properties, basis)
        couplings = couplings_of_properties(properties, _number)
        calibrated = properties.last_update_date
    else:
        calibrations = _of_target(backend.target, basis)
        couplings = couplings_of_target(backend.target)
        calibrated = None
        notes = ("Readout errors are symmetric: the backend's target has one number per qubit.",)
    faulty = set(properties.faulty_qubits()) if properties is not None else set()
    qubits: list[Qubit] = []
    left_out: dict[int, str] = {}
    for index, values in enumerate(calibrations):
        try:
            qubits.append(_qubit(index, values))
        except _UnknownQubitError as unknown:
            qubits.append(_placeholder_qubit(unknown))
            left_out[index] = str(unknown)
        if index in faulty:
            left_out.setdefault(index, f"Qubit {index} is marked as faulty by IBM.")
    if left_out and len(left_out) == len(qubits):
        raise DeviceError(
            f"No qubit of {name} has all its values. {left_out[0]}",
            "A device needs at least one; write the file by hand or try another backend.",
        )
    try:
        return Device(
            format="qcompile-device-2" if couplings else "qcompile-device-1",
            name=name,
            source=_source(backend),
            calibrated=calibrated.isoformat() if calibrated else None,
            basis_gates=basis,
            notes=(*notes, *notes_on(qubits, left_out), *_left_out_notes(left_out)),
            qubits=tuple(qubits),
            left_out=tuple(left_out),
            couplings=tuple(couplings),
            positions=positions_of(backend, len(qubits)) if couplings else (),
        )
    except ValidationError as error:
        raise DeviceError(f"{name} cannot be turned into a device.", *explain(error)) from error


def _source(backend: Any) -> str:
    package = type(backend).__module__.partition(".")[0]
    try:
        release = f"{package.replace('_', '-')} {metadata.version(package)}"
    except metadata.PackageNotFoundError:
        release = package
    machine = f"{backend.name} {getattr(backend, 'backend_version', None) or ''}".rstrip()
    return f"{release}, {type(backend).__name__} ({machine})"


_Calibration = tuple[Mapping[str, float | None], Mapping[str, Mapping[str, float | None]]]
"""Values of a qubit by property, and of its gates by gate and property."""


def _of_properties(properties: Any, basis: Iterable[str]) -> Iterator[_Calibration]:
    gates = {(g.gate, g.qubits[0]): g for g in properties.gates if len(g.qubits) == 1}
    for index, values in enumerate(properties.qubits):
        qubit_values = {v.name: _value(index, v) for v in values if v.name in _QUBIT_UNITS_NS}
        parameters = {
            gate: gates[gate, index].parameters if (gate, index) in gates else () for gate in basis
        }
        yield (
            qubit_values,
            {
                gate: {v.name: _value(index, v) for v in entries if v.name in _GATE_UNITS_NS}
                for gate, entries in parameters.items()
            },
        )


def _value(qubit: int, entry: Any) -> float:
    """The value of a named number with a unit: T1 and T2 in us, lengths in ns, errors as given."""
    try:
        return _number(entry)
    except DeviceError as error:
        raise DeviceError(f"Qubit {qubit}: {error}") from error


def _number(entry: Any) -> float:
    wanted = {**_QUBIT_UNITS_NS, **_GATE_UNITS_NS}.get(entry.name)
    if wanted is None:
        return float(entry.value)
    if entry.unit not in _NS:
        raise DeviceError(
            f"{entry.name} has the unit {entry.unit!r}.", f"Known units: {', '.join(_NS)}."
        )
    return float(entry.value) * (_NS[entry.unit] / wanted)


def _of_target(target: Any, basis: Iterable[str]) -> Iterator[_Calibration]:
    for index in range(target.num_qubits or 0):
        properties = target.qubit_properties[index] if target.qubit_properties else None
        measure = _instruction(target, "measure", index)
        gates = {gate: _instruction(target, gate, index) for gate in basis}
        error = measure.get("gate_error")
        yield (
            {
                "T1": _scaled(getattr(properties, "t1", None), 1e6),
                "T2": _scaled(getattr(properties, "t2", None), 1e6),
                "prob_meas1_prep0": error,
                "prob_meas0_prep1": error,
                "readout_length": measure.get("gate_length"),
            },
            gates,
        )


def _instruction(target: Any, name: str, qubit: int) -> dict[str, float | None]:
    if name not in target.operation_names:
        return {}
    properties = (target[name] or {}).get((qubit,))
    if properties is None:
        return {}
    return {"gate_error": properties.error, "gate_length": _scaled(properties.duration, 1e9)}


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


class _UnknownQubitError(Exception):
    """A qubit's calibration lacks a value, or has an impossible one."""


def _placeholder_qubit(unknown: _UnknownQubitError) -> Qubit:
    """A placeholder for a qubit that is left out; its numbers have no meaning."""
    return Qubit(t1_us=1.0, t2_us=1.0, p10=0.5, p01=0.5, doubtful=(str(unknown)[:500],))


def _left_out_notes(left_out: Mapping[int, str]) -> Iterator[str]:
    if left_out:
        qubits = ", ".join(map(str, left_out))
        yield f"Left out because they are faulty or lack values: {qubits}."[:500]


def _qubit(index: int, calibration: _Calibration) -> Qubit:
    values, gate_values = calibration

    def need(entries: Mapping[str, float | None], key: str, of: str = "") -> float:
        value = entries.get(key)
        if value is None:
            raise _UnknownQubitError(f"Qubit {index} has no {key}{of} in its calibration.")
        return value

    gates = {}
    for gate, entries in gate_values.items():
        if gate == "rz" and not entries.get("gate_error"):
            continue  # virtual: a rotation of the frame, without noise
        gates[gate] = {
            "error": need(entries, "gate_error", f" of {gate}"),
            "length_ns": need(entries, "gate_length", f" of {gate}"),
        }
    try:
        qubit = Qubit(
            t1_us=need(values, "T1"),
            t2_us=need(values, "T2"),
            p10=need(values, "prob_meas1_prep0"),
            p01=need(values, "prob_meas0_prep1"),
            readout_ns=values.get("readout_length"),
            gates={gate: GateCalibration(**entries) for gate, entries in gates.items()},
        )
    except ValidationError as error:
        words = f"Qubit {index} has an impossible value: {'; '.join(explain(error))}"
        raise _UnknownQubitError(words) from error
    return qubit.model_copy(update={"doubtful": tuple(implausible_values(qubit))})
