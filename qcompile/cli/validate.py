"""`qcompile validate`: whether a calibration's twin shows what its machine does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import Share, echo_json, echo_note, json_option
from qcompile.limits import MAX_SHOTS

if TYPE_CHECKING:
    from qcompile.verbs.live import Live

_ADVICE = (
    "Calibrate anew: `qcompile calibrate`. If a new one fails too, the qubits depend on their "
    "neighbours: use other qubits, with an unused one between them."
)


@click.command("validate")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--policy", default="lunarlander", show_default=True, help="Whose circuits are compared."
)
@click.option(
    "--observations",
    "rows",
    type=click.IntRange(1, 1000),
    help="How many, from episodes that the policy plays on the twin.  [default: by --power]",
)
@click.option(
    "--shots",
    type=click.IntRange(1, MAX_SHOTS),
    help="Shots of each circuit.  [default: by --power]",
)
@click.option(
    "--power",
    type=Share(open_end=True),
    help="How often a moved qubit is to be found; chooses observations and shots.  [default: 0.9]",
)
@click.option(
    "--effect",
    type=Share(),
    default=0.05,
    show_default=True,
    help="How far the p01 of a moved qubit is raised.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Draws the episodes."
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
    rows: int | None,
    shots: int | None,
    power: float | None,
    effect: float,
    seed: int,
    backend: str | None,
    live: Live | None,
    as_json: bool,
) -> None:
    """Run a policy's circuits and compare their counts with the twin of the calibration FILE.

    Exit 1 where a qubit contradicts its curve (chi-square, once in a thousand times by chance). It
    takes the fewest executions that find a p01 of any one qubit raised by --effect with --power.
    With --live on the machine that FILE was measured on, for a few seconds.
    """
    is_free = rows is None or shots is None
    if power is not None and not is_free:
        raise click.UsageError(
            "--power chooses --observations and --shots: leave one of the three out."
        )
    if live is not None and backend is not None:
        raise click.UsageError("--backend and --live exclude each other: FILE names the machine.")
    from qcompile.calibration import load_calibration
    from qcompile.deploy.twin_check import wide_observations
    from qcompile.deploy.twin_power import POWER, choose_check
    from qcompile.errors import CalibrationError
    from qcompile.mitigation.misfit import misfit_words
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values
    from qcompile.report.live import charged, print_validation
    from qcompile.verbs.live import spend

    calibration, loaded = load_calibration(file), load_policy(policy)
    observations, shots, least = choose_check(
        calibration,
        loaded,
        wide_observations(loaded, calibration, seed),
        rows=rows,
        shots=shots,
        power=power or POWER,
        effect=effect,
    )
    if is_free and least < (power or POWER):
        click.echo(
            f"A p01 raised by {effect:g} is found {100 * least:.0f} % of the time at least: {file} "
            "has too few shots for more. Calibrate with more of them.",
            err=True,
        )
    if live is None:
        found: dict[str, Any] = {"file": str(file), "shots": shots}
        found |= _offline(calibration, loaded, observations, backend, shots, seed, effect)
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
                "effect": effect,
            }
        )
        found = spend(task, task.load, live, connection, echo_note)
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
            *(misfit_words(found["calibration_misfits"]) or [_ADVICE]),
        )


def _offline(
    calibration: Any,
    policy: Any,
    observations: Any,
    backend: str | None,
    shots: int,
    seed: int,
    effect: float,
) -> dict[str, Any]:
    import numpy as np

    from qcompile.deploy.twin_check import check_twin
    from qcompile.execution import open_executor

    # A stream of its own: `calibrate --seed` draws from that of the number itself.
    (fresh,) = np.random.SeedSequence(seed).spawn(1)
    executor = open_executor(backend or calibration.device, fresh)
    return check_twin(calibration, policy, observations, executor, shots, effect).values()
