"""`qcompile validate`: whether a calibration's twin shows what its machine does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from qcompile.cli.live_options import Live, live_options, spend
from qcompile.cli.options import echo_json, json_option
from qcompile.limits import MAX_SHOTS


@click.command("validate")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--policy", default="lunarlander", show_default=True, help="Whose circuits are compared."
)
@click.option(
    "--observations",
    "rows",
    type=click.IntRange(1, 1000),
    default=4,
    show_default=True,
    help="Random ones, of episodes that the policy plays on the twin.",
)
@click.option(
    "--shots", type=click.IntRange(1, MAX_SHOTS), default=2048, show_default=True,
    help="Shots of each circuit.",
)  # fmt: skip
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Draws the observations."
)
@click.option(
    "--backend",
    metavar="NAME",
    help="Without --live: compare with this noise model, calibration or qiskit:NAME.  [default: "
    "the device of the file]",
)
@live_options
@json_option
def command(
    file: Path,
    policy: str,
    rows: int,
    shots: int,
    seed: int,
    backend: str | None,
    live: Live | None,
    as_json: bool,
) -> None:
    """Run a policy's circuits and compare their counts with the twin of the calibration FILE.

    Exit 1 where a qubit contradicts its curve (chi-square, once in a thousand times by chance).
    With --live on the machine that FILE was measured on, for a few seconds.
    """
    if live is not None and backend is not None:
        raise click.UsageError("--backend and --live exclude each other: FILE names the machine.")
    from qcompile.calibration import load_calibration
    from qcompile.errors import CalibrationError
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values
    from qcompile.report.live import charged, print_validation
    from qcompile.rl.twin_check import random_observations

    calibration, loaded = load_calibration(file), load_policy(policy)
    observations = random_observations(loaded, calibration, rows, seed)
    if live is None:
        found: dict[str, Any] = {"file": str(file), "shots": shots}
        found |= _offline(calibration, loaded, observations, backend, shots, seed)
    else:
        from qcompile.live.connection import Connection
        from qcompile.live.validate import ValidateTask

        connection = Connection(calibration.backend, live.account, live.instance)
        machine = connection.device()
        if len(machine.qubits) != len(calibration.device.qubits):
            raise CalibrationError(
                f"{file} has {len(calibration.device.qubits)} qubits, {machine.name} has "
                f"{len(machine.qubits)}.",
                "Calibrate the machine anew.",
            )
        task = ValidateTask.model_validate(
            {
                **live.where,
                "backend": calibration.backend,
                "device": calibration.device,
                "calibration": calibration,
                "calibration_file": str(file),
                "policy": policy_values(loaded),
                "observations": observations.tolist(),
                "shots": shots,
            }
        )
        found = spend(task, task.load, live, connection)
    if as_json:
        echo_json(found)
    else:
        print_validation(found)
        if live is not None:
            click.echo(charged(found))
    if not found["passed"]:
        raise CalibrationError(
            f"The twin of {file} is not its machine any more: qubit "
            f"{', '.join(map(str, found['failed']))}.",
            "Calibrate anew: `qcompile calibrate`.",
        )


def _offline(
    calibration: Any, policy: Any, observations: Any, backend: str | None, shots: int, seed: int
) -> dict[str, Any]:
    from qcompile.execution import open_executor
    from qcompile.rl.twin_check import check_twin

    executor = open_executor(backend or calibration.device, seed)
    return check_twin(calibration, policy, observations, executor, shots).values()
