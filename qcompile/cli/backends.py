"""`qcompile backends`: list, show and add devices."""

from __future__ import annotations

from pathlib import Path

import click

from qcompile.cli.options import echo_json, json_option


@click.group("backends", invoke_without_command=True)
@json_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """List the devices known by name; `show` one of them, or `add` another."""
    from qcompile.device import device_names, load_device
    from qcompile.report.devices import print_devices

    if ctx.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError("Put --json at the end: backends show NAME --json")
        return
    devices = {name: load_device(name) for name in device_names()}
    if as_json:
        echo_json([device.model_dump() for device in devices.values()])
        return
    print_devices(devices)


@command.command("show")
@click.argument("name")
@json_option
def show(name: str, as_json: bool) -> None:
    """Show the calibration of every qubit of a device."""
    from qcompile.execution import open_device
    from qcompile.report.devices import print_qubits

    device = open_device(name)
    if as_json:
        echo_json(device.model_dump())
        return
    print_qubits(device)


@command.command("add")
@click.argument("backend")
@click.option("--name", help="Name of the device.  [default: from --out, or the backend's]")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write.  [default: hardware/NAME.json]",
)
def add(backend: str, name: str | None, out: Path | None) -> None:
    """Write a Qiskit fake backend, such as FakeLimaV2, to a device file.

    FakeLimaV2, fake_lima and qiskit:FakeLimaV2 are the same backend. Device files in the folder
    hardware/ can be used by name.
    """
    from qcompile.device import IDEAL_NAME
    from qcompile.errors import OutputError
    from qcompile.output import write_file
    from qcompile.snapshot import device_from_backend, find_backend

    if name == IDEAL_NAME:
        raise click.BadParameter(
            f"{name!r} is the name of the noiseless backend.", param_hint="'--name'"
        )
    snapshot = find_backend(backend)
    device = device_from_backend(snapshot, name or (out.stem if out else None))
    path = out or Path("hardware") / f"{device.name}.json"
    if path.exists():
        raise OutputError(f"{path} already exists.", "Choose another with --out or --name.")
    write_file(path, device.to_json().encode())
    click.echo(f"{device.name}, {len(device.qubits)} qubits, written to {path}")
    for note in device.notes:
        click.echo(note)
