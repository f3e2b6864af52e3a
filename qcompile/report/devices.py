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
        ["backend", "qubits", "T1 us", "sx error", "readout error", "calibrated"],
        [
            [
                name,
                len(device.qubits) or "any",
                *_medians(device),
                (device.calibrated or "").partition("T")[0],
            ]
            for name, device in devices.items()
        ],
        "Numbers are medians over the qubits",
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


def print_qubits(device: Device) -> None:
    """Print the calibration of every qubit, where it is from, and what of it is doubtful."""
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
    for line in (device.source, *device.notes):
        click.echo(line)
    for index, qubit in enumerate(device.qubits):
        for doubt in qubit.doubtful:
            click.echo(f"qubit {index}: {doubt}")
