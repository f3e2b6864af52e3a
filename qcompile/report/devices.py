"""Devices and their qubits, in tables."""

from __future__ import annotations

import statistics
from collections.abc import Mapping

import click

from qcompile.device import Device
from qcompile.noise import usable
from qcompile.report.tables import print_table


def print_devices(devices: Mapping[str, Device]) -> None:
    """Print a row for each device: medians of its qubits but those that are left out."""
    print_table(
        ["backend", "qubits", "T1 us", "sx error", "readout error", "coupling error", "calibrated"],
        [
            [
                name,
                len(device.qubits) or "any",
                *_medians(device),
                _coupling_error(device),
                (device.calibrated or "").partition("T")[0],
            ]
            for name, device in devices.items()
        ],
        "Numbers are medians over the qubits, and over the couplings",
    )


def _medians(device: Device) -> tuple[str, str, str]:
    """T1 in microseconds, the error of sx where every qubit has it, the readout error."""
    qubits = [q for index, q in enumerate(device.qubits) if index not in device.left_out]
    if not qubits:
        return "-", "-", "-"
    sx_error = "-"
    if all("sx" in qubit.gates for qubit in qubits):
        sx_error = f"{statistics.median(qubit.gates['sx'].error for qubit in qubits):.1e}"
    return (
        f"{statistics.median(qubit.t1_us for qubit in qubits):.0f}",
        sx_error,
        f"{statistics.median((qubit.p10 + qubit.p01) / 2 for qubit in qubits):.3f}",
    )


def _coupling_error(device: Device) -> str:
    """The median error of the couplings, and their gate; - where there are none."""
    if not device.couplings:
        return "-"
    error = statistics.median(coupling.error for coupling in device.couplings)
    return f"{error:.1e} {'/'.join(device.coupling_gates)}"


def print_qubits(device: Device) -> None:
    """Print the calibration of every qubit and coupling, its source, and what is doubtful."""
    used = usable(device)
    gates = sorted({gate for qubit in device.qubits for gate in qubit.gates})
    print_table(
        ["qubit", "T1 us", "T2 us", "P(1|0)", "P(0|1)", *(f"{g} error" for g in gates), "used"],
        [
            [
                index,
                qubit.t1_us,
                qubit.t2_us,
                qubit.p10,
                qubit.p01,
                *(qubit.gates[g].error if g in qubit.gates else 0.0 for g in gates),
                "yes" if index in used else "no",
            ]
            for index, qubit in enumerate(device.qubits)
        ],
        f"{device.name}: {' '.join(device.basis_gates)}",
    )
    if device.couplings:
        print_table(["control, target", "gate", "error", "length ns"], _coupling_rows(device))
    for line in (device.source, *device.notes):
        click.echo(line)
    for index, qubit in enumerate(device.qubits):
        for doubt in qubit.doubtful:
            click.echo(f"qubit {index}: {doubt}")


def _coupling_rows(device: Device) -> list[list[object]]:
    """A row for each coupling; one for both directions where they are the same."""
    known, rows = device.coupling_calibrations, []
    for (gate, first, second), each in sorted(known.items(), key=lambda item: item[0][1:]):
        back = known.get((gate, second, first))
        is_same = back is not None and (back.error, back.length_ns) == (each.error, each.length_ns)
        if not is_same:
            rows.append([f"{first}, {second}", gate, each.error, each.length_ns])
        elif first < second:
            rows.append([f"{first}, {second} both ways", gate, each.error, each.length_ns])
    return rows
