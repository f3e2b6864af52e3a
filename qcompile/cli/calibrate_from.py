"""What `qcompile calibrate --from` does: fit kept counts anew."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource

from qcompile.cli.calibrate_outputs import check_fitted, check_out, check_plot, show_calibration
from qcompile.cli.options import check_distinct

_ALLOWED = {"from_file", "qubits", "out", "force", "plot", "as_json"}


def refit(
    ctx: click.Context,
    from_file: Path,
    qubits: tuple[int, ...] | None,
    out: Path | None,
    force: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Fit the counts of `from_file` anew: nothing is measured, and nothing is spent.

    Raises:
        CalibrationError: there are no counts, or not everything can be fitted.
        click.UsageError: an option of a measurement is given.
        OutputError: a file is there already, or cannot be written.
    """
    for param in ctx.command.params:
        source = ctx.get_parameter_source(str(param.name))
        if param.name not in _ALLOWED and source is ParameterSource.COMMANDLINE:
            raise click.UsageError(
                f"{param.opts[0]} is for a measurement: --from measures nothing."
            )
    check_plot(plot)
    check_distinct({"--from": from_file, "--plot": plot})
    from qcompile.calibration import load_counts
    from qcompile.mitigation import fit_counts
    from qcompile.output import check_writable
    from qcompile.report.calibration_values import calibration_values

    counted = load_counts(from_file)
    out = out or Path(f"{counted.backend}-calibration.json")
    check_distinct({"--out": out, "--plot": plot})
    check_out(out, force)
    if plot is not None:
        check_writable(plot)
    calibration = fit_counts(counted, qubits)
    calibration.save(out)
    check_fitted(calibration, out)
    values = calibration_values(calibration) | {"file": str(out)}
    show_calibration(calibration, values, out, plot, as_json)
