"""`qcompile calibrate`: measure the readout and the response of a device's qubits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.live_options import live_options
from qcompile.cli.options import check_only, echo_json, echo_note, json_option
from qcompile.cli.outputs import Outputs, output_options, report_option
from qcompile.cli.types import Integer, NamePath, Parts, Positive, Qubits, Shots

if TYPE_CHECKING:
    from qcompile.mitigation.measure import Part
    from qcompile.verbs.calibrations import CalibrationResult
    from qcompile.verbs.live import Live

_REFIT_OPTIONS = {
    *("from_file", "qubits", "out", "force"),
    *("plot", "style", "table", "report", "as_json"),
}
"""The options that can be used with --from."""


@click.command("calibrate")
@click.option(
    "--backend",
    type=NamePath(),
    metavar="NAME",
    help="Device name, device file, calibration file, or qiskit:NAME for a Qiskit backend; with "
    "--live an IBM machine.",
)
@click.option(
    "--from",
    "from_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Run nothing; fit the counts in this calibration file again.",
)
@click.option(
    "--shots", type=Shots(), default=8192, show_default=True, help="Shots of each circuit."
)
@click.option("--qubits", type=Qubits(), help="Qubits to measure.  [default: all usable ones]")
@click.option(
    "--policy",
    type=NamePath(),
    help="Measure the qubits that this policy's circuits are placed on.",
)
@click.option(
    "--parts",
    type=Parts(),
    help="What to measure.  [default: both; with --live response, or readout for a policy with "
    "couplings]",
)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write.  [default: BACKEND-calibration.json; none with --check]",
)
@click.option("--force", is_flag=True, help="Overwrite the file.")
@output_options("curves, residuals and readout errors", "calibration")
@click.option(
    "--check",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Check whether this calibration still holds against fresh counts; exit 1 if not. Measures "
    "its qubits and parts by default.",
)
@click.option(
    "--max-age-hours",
    type=Positive("hours"),
    help="With --check: the greatest age at which the calibration holds.  [default: 24]",
)
@click.option("--seed", type=Integer(0), help="Seed of the shots.  [default: a new one each time]")
@report_option
@live_options
@json_option
def command(
    backend: str | None,
    from_file: Path | None,
    shots: int | None,
    qubits: tuple[int, ...] | None,
    policy: str | None,
    parts: tuple[Part, ...] | None,
    out: Path | None,
    force: bool,
    check: Path | None,
    max_age_hours: float | None,
    seed: int | None,
    as_json: bool,
    live: Live | None,
    outputs: Outputs,
) -> None:
    """Measure the readout and response of a device's qubits, and write them to a file.

    Readout: how often 0 is read as 1, and 1 as 0. Response: the curve of measured `<Z>` against
    the angle of a rotation, which includes gate errors.

    `qcompile run --calibration FILE` mitigates with the file. `qcompile run --backend FILE` plays
    on the twin: a simulation of the device by its measured response curves.
    """
    from qcompile.verbs.calibrate import calibrate_into, check_calibration, refit
    from qcompile.verbs.calibration_request import CalibrationRequest

    if from_file is not None:
        check_only(_REFIT_OPTIONS, "--from", "nothing is run")
        refitted = refit(from_file, qubits, out=out, force=force)
        _show(refitted, as_json)
        outputs.save(refitted)
        return
    if backend is None:
        raise click.UsageError(
            "Give --backend NAME to measure a device, or --from FILE to fit stored counts."
        )
    if max_age_hours is not None and check is None:
        raise click.UsageError("--max-age-hours needs --check.")
    request = CalibrationRequest(
        backend, qubits, shots, policy, parts, seed, live=live, on_note=echo_note
    )
    if check is None:
        calibrated = calibrate_into(request, out, force=force)
        _show(calibrated, as_json)
        outputs.save(calibrated)
        return
    checked = check_calibration(check, request, max_age_hours=max_age_hours, out=out, force=force)
    _show(checked, as_json)
    outputs.save(checked, checked.check_holds)


def _show(result: CalibrationResult, as_json: bool) -> None:
    from qcompile.mitigation.misfit import misfit_warnings
    from qcompile.report.calibration_values import print_calibration
    from qcompile.report.live import charged

    values = result.to_dict()
    if as_json:
        echo_json(values)
        return
    print_calibration(values)
    lines = misfit_warnings(values["calibration_misfits"])
    if check := values.get("check"):
        drifted = ", ".join(map(str, check["drifted"])) or "none"
        age = f"{check['age_hours']:.1f} hours old"
        lines.append(f"{check['file']} is {age}; drifted qubits: {drifted}")
    if result.file is not None:
        lines.append(f"calibration written to {result.file}")
    if "run" in values:
        lines.append(charged(values))
    for line in lines:
        click.echo(line)
