"""`qcompile export`: a policy's circuits as an OpenQASM job."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from qcompile.cli.options import backend_option, echo_json, json_option, level_option
from qcompile.cli.types import Integer
from qcompile.limits import MAX_SHOTS
from qcompile.output import file_name


@click.command("export")
@click.argument("policy", default="lunarlander", metavar="[POLICY]")
@backend_option()
@level_option
@click.option(
    "--format",
    type=click.Choice(["qasm3", "qasm2"]),
    default="qasm3",
    show_default=True,
    help="OpenQASM version to write.",
)
@click.option(
    "--shots",
    type=Integer(1, MAX_SHOTS),
    default=8192,
    show_default=True,
    help="Number of shots to write in job.json.",
)
@click.option(
    "--observations",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Compute the angles for these observations: a .npy, .csv or .json file with one per row.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="New folder for job.json and the program files.  [default: POLICY-job]",
)
@json_option
def command(
    policy: str,
    backend: str,
    level: int,
    format: Literal["qasm3", "qasm2"],
    shots: int,
    observations: Path | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Write the circuits of POLICY, compiled for a backend, as OpenQASM.

    Without --observations, the programs have inputs for the angles. With --observations, there is
    one program per observation, with all angles filled in. If the device has too few qubits for all
    circuits at once, they are spread over several programs, called rounds.
    """
    from qcompile.execution import open_device
    from qcompile.jobs.policy_job import export_job, read_observations
    from qcompile.policy import load_circuits
    from qcompile.report.progress import progress_bar
    from qcompile.report.tables import print_hold

    device = open_device(backend)
    loaded = load_circuits(policy)
    folder = out or Path(f"{file_name(loaded.name)}-job")
    rows = None if observations is None else read_observations(observations, loaded)
    with progress_bar(f"{loaded.name} for {device.name}", 1 if rows is None else len(rows)) as show:
        job = export_job(
            loaded,
            device,
            folder,
            level=level,
            format=format,
            shots=shots,
            observations=rows,
            on_row=lambda done: show(done, "observations"),
        )
    if as_json:
        echo_json(job)
        return
    click.echo(
        f"{len(job['programs'])} program(s) of {len(loaded.program)} circuits for {device.name} "
        f"at level {level}, and job.json, in {folder}"
    )
    print_hold(loaded.hold)
