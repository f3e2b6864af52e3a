"""`qcompile calibrate`: measure the readout and the response of a device's qubits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from qcompile.cli.live_options import live_options
from qcompile.cli.options import Parts, Positive, Qubits, Shots, echo_json, echo_note, json_option
from qcompile.cli.outputs import Outputs, plot_option, style_option, table_option

if TYPE_CHECKING:
    from qcompile.mitigation.measure import Part
    from qcompile.verbs.calibrations import CalibrationResult
    from qcompile.verbs.live import Live

_OF_REFIT = {"from_file", "qubits", "out", "force", "plot", "style", "table", "as_json"}
"""The options that go with --from."""


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
@plot_option("curves, residuals and readout errors")
@style_option
@table_option
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
    style: Path | None,
    table: Path | None,
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
    from qcompile.verbs.calibrate import calibrate_into, check_calibration, refit
    from qcompile.verbs.calibration_request import CalibrationRequest

    outputs = Outputs(plot, style, table)
    outputs.check()
    if from_file is not None:
        _refuse_measuring(ctx)
        refitted = refit(from_file, qubits, out=out, force=force, plot=plot, style=style)
        _show(refitted, outputs, as_json)
        return
    if backend is None:
        raise click.UsageError("--backend names what to measure; --from FILE fits kept counts.")
    if max_age_hours is not None and check is None:
        raise click.UsageError("--max-age-hours is for --check: nothing else looks at the age.")
    request = CalibrationRequest(
        backend, qubits, shots, policy, parts, seed, live=live, on_note=echo_note
    )
    if check is None:
        calibrated = calibrate_into(request, out, force=force, plot=plot, style=style)
        _show(calibrated, outputs, as_json)
        return
    checked = check_calibration(
        check, request, max_age_hours=max_age_hours, out=out, force=force, plot=plot, style=style
    )
    _show(checked, outputs, as_json)
    checked.check_holds()


def _refuse_measuring(ctx: click.Context) -> None:
    """Raise click.UsageError where an option of a measurement stands beside --from."""
    for param in ctx.command.params:
        source = ctx.get_parameter_source(str(param.name))
        if param.name not in _OF_REFIT and source is ParameterSource.COMMANDLINE:
            raise click.UsageError(
                f"{param.opts[0]} is for a measurement: --from measures nothing."
            )


def _show(result: CalibrationResult, outputs: Outputs, as_json: bool) -> None:
    from qcompile.mitigation.misfit import misfit_words
    from qcompile.report.calibration_values import print_calibration
    from qcompile.report.live import charged

    if outputs.table is not None:
        result.table().save(outputs.table)
    values = result.to_dict()
    if as_json:
        echo_json(values)
        return
    print_calibration(values)
    lines = misfit_words(values["calibration_misfits"])
    if check := values.get("check"):
        drifted = ", ".join(map(str, check["drifted"])) or "none"
        age = f"{check['age_hours']:.1f} hours old"
        lines.append(f"{check['file']} is {age}; drifted qubits: {drifted}")
    written = {"calibration": result.file, "figure": outputs.plot, "table": outputs.table}
    lines += [f"{what} in {path}" for what, path in written.items() if path]
    if "run" in values:
        lines.append(charged(values))
    for line in lines:
        click.echo(line)
