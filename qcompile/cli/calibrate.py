"""`qcompile calibrate`: measure the readout and the response of a device's qubits."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.calibrate_check import MAX_AGE_HOURS, comparable, comparison, failures
from qcompile.cli.calibrate_from import refit
from qcompile.cli.calibrate_outputs import check_fitted, check_out, check_plot, show_calibration
from qcompile.cli.live_options import live_options
from qcompile.cli.options import (
    PARTS,
    Parts,
    Positive,
    Qubits,
    Shots,
    check_distinct,
    echo_note,
    json_option,
)

if TYPE_CHECKING:
    from qcompile.calibration import Calibration
    from qcompile.device import Device
    from qcompile.mitigation.measure import Part
    from qcompile.verbs.live import Live


@click.command("calibrate")
@click.option(
    "--backend",
    metavar="NAME",
    help="Device by name or file, calibration file (its twin), or qiskit:NAME; with --live a "
    "machine of IBM's.",
)
@click.option(
    "--from",
    "from_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Measure nothing: fit the counts of this calibration anew, on its --qubits or all.",
)
@click.option(
    "--shots", type=Shots(), default=8192, show_default=True, help="Shots of each circuit."
)
@click.option("--qubits", type=Qubits(), help="Qubits to measure.  [default: all usable ones]")
@click.option("--policy", help="Measure the qubits that this policy's circuits are placed on.")
@click.option("--parts", type=Parts(), help="What to measure.  [default: both]")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write.  [default: BACKEND-calibration.json; none with --check]",
)
@click.option("--force", is_flag=True, help="Overwrite the file.")
@click.option(
    "--plot",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw curves, residuals and readout errors; .png, overwritten.",
)
@click.option(
    "--check",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Compare fresh counts with this calibration; exit 1 where it no longer holds. Its qubits "
    "and parts are the default.",
)
@click.option(
    "--max-age-hours",
    type=Positive("hours"),
    help="For --check: an older calibration does not hold.  [default: 24]",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Draw the same shots again.  [default: new ones]"
)
@live_options
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    backend: str | None,
    from_file: Path | None,
    shots: int | None,
    qubits: tuple[int, ...] | None,
    policy: str | None,
    parts: tuple[Part, ...] | None,
    out: Path | None,
    force: bool,
    plot: Path | None,
    check: Path | None,
    max_age_hours: float | None,
    seed: int | None,
    as_json: bool,
    live: Live | None,
) -> None:
    """Measure the readout and the response of a device's qubits, and fit them.

    `run --calibration FILE` mitigates with the file, `run --backend FILE` plays it. With --live
    IBM's machine of that name is measured, the response alone unless --parts says more. --from FILE
    fits counts again that are there.
    """
    if from_file is not None:
        refit(ctx, from_file, qubits, out, force, plot, as_json)
        return
    if backend is None:
        raise click.UsageError("--backend names what to measure; --from FILE fits kept counts.")
    if qubits is not None and policy is not None:
        raise click.UsageError("--qubits and --policy exclude each other: both name the qubits.")
    check_plot(plot)
    if max_age_hours is not None and check is None:
        raise click.UsageError("--max-age-hours is for --check: nothing else looks at the age.")
    if force and check is not None and out is None:
        raise click.UsageError("--force overwrites a file: --check writes none without --out.")
    if check is not None and shots is None:
        raise click.UsageError("--check compares counts: --shots exact has none.")
    if live is not None and (shots is None or seed is not None):
        wrong = "--seed" if seed is not None else "--shots exact"
        raise click.UsageError(f"{wrong} and --live exclude each other.")
    check_distinct({"--check": check, "--plot": plot})
    import numpy as np

    from qcompile.calibration import Calibration, load_calibration
    from qcompile.errors import CalibrationError
    from qcompile.execution import open_executor
    from qcompile.live.connection import Connection
    from qcompile.live.measure import CalibrateTask
    from qcompile.mitigation import calibrate, measure_drift
    from qcompile.mitigation.measure import LIVE_ANGLES_RAD, RESPONSE_ANGLES_RAD
    from qcompile.mitigation.orders import angle_orders
    from qcompile.noise import unusable
    from qcompile.output import check_writable, resolved
    from qcompile.report.calibration_values import calibration_values
    from qcompile.report.live import charged, result_values
    from qcompile.report.placement import left_out_words
    from qcompile.report.progress import progress_bar
    from qcompile.verbs.live import spend

    old = None if check is None else load_calibration(check)
    connection = executor = None
    if live is not None:
        connection = Connection(backend, live.account, live.instance)
        device = connection.device()
    else:
        executor = open_executor(backend, seed)
        device = executor.device
    measured = _qubits(device, qubits, policy, old)
    if qubits is None and policy is None and old is None and (reasons := unusable(device)):
        click.echo(left_out_words(reasons), err=True)
    numbers = np.array(measured)
    angles_rad = angle_orders(RESPONSE_ANGLES_RAD if live is None else LIVE_ANGLES_RAD, numbers)
    if old is not None:
        parts = comparable(old, device, measured, parts)
        if old.response_counts is not None:
            angles_rad = old.response_counts.angles[:, old.rows(numbers)]
    if out is None and check is None:
        out = Path(f"{device.name}-calibration.json")
    check_distinct({"--out": out, "--plot": plot})
    check_out(out, force)
    if plot is not None:
        check_writable(plot)

    if executor is None:
        assert live is not None
        assert connection is not None
        assert shots is not None
        task = CalibrateTask(
            backend=backend,
            device=device,
            qubits=tuple(measured),
            shots=shots,
            parts=parts or ("response",),
            angles_rad=tuple(map(tuple, angles_rad.tolist())),
            out=None if out is None else str(resolved(out)),
            force=force,
            **live.where,
        )
        found = spend(task, task.load, live, connection, echo_note)
        calibration = Calibration.model_validate(found["calibration"])
        values = result_values("calibrate", found)
        if out is not None and str(resolved(out)) != found["file"]:  # a file came in between
            out = Path(found["file"])
    else:
        try:
            with progress_bar(f"calibrate {device.name}", 1) as show:
                calibration = calibrate(
                    executor,
                    numbers,
                    shots,
                    parts=parts or PARTS,
                    angles_rad=angles_rad,
                    on_circuit=lambda done, of: show(done / of, f"circuit {done} of {of}"),
                )
        except KeyboardInterrupt:
            raise CalibrationError("Interrupted: nothing was written.") from None
        if out is not None:
            calibration.save(out)
        values = calibration_values(calibration) | {"file": None if out is None else str(out)}
    check_fitted(calibration, out)
    failed: list[str] = []
    if old is not None:
        drift = measure_drift(old, calibration)
        age = old.age_hours(datetime.now(UTC))
        values["check"] = {
            "file": str(check),
            "age_hours": age,
            "drifted": drift.drifted,
            "degrees": drift.degrees_of_freedom,
            "chi_square": drift.chi_square.tolist(),
            "p_value": drift.p_value.tolist(),
        }
        failed = failures(values, max_age_hours or MAX_AGE_HOURS)
    last = [comparison(values)] if old is not None else []
    paid = [charged(values)] if live is not None else []
    show_calibration(calibration, values, out, plot, as_json, last, paid)
    if failed:
        raise CalibrationError(
            f"{check} no longer holds.", *failed, f"Use a new one: --backend {backend} --out FILE"
        )


def _qubits(
    device: Device, asked: tuple[int, ...] | None, policy: str | None, old: Calibration | None
) -> Sequence[int]:
    """The qubits to measure: asked for, of a policy, of the old calibration, or the usable ones."""
    from qcompile.errors import CalibrationError
    from qcompile.noise import usable

    if asked is not None:
        if not device.is_ideal and asked[-1] >= len(device.qubits):
            raise CalibrationError(
                f"{device.name} has no qubit {asked[-1]}.",
                f"Its qubits are 0 to {len(device.qubits) - 1}.",
            )
        return asked
    if device.is_ideal and old is None:
        raise CalibrationError(
            f"{device.name} needs no calibration: it has no errors.",
            "To measure some of its perfect qubits all the same, name them with --qubits.",
        )
    if policy is not None:
        from qcompile.passes import compile
        from qcompile.policy import load_policy

        loaded = load_policy(policy)
        placed = compile(loaded.trained_program, device, 2, loaded.importance).qubits
        return sorted(set(placed.tolist()))
    return sorted(usable(device)) if old is None else old.qubits
