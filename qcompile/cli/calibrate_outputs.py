"""Where `qcompile calibrate` writes what it found, and how it shows it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import echo_json

if TYPE_CHECKING:
    from qcompile.calibration import Calibration


def check_plot(plot: Path | None) -> None:
    if plot is not None and plot.suffix != ".png":
        raise click.BadParameter(f"{plot} must end with .png.", param_hint="'--plot'")


def check_out(out: Path | None, force: bool) -> None:
    from qcompile.errors import OutputError
    from qcompile.output import check_writable

    if out is None:
        return
    if out.is_file() and not force:
        raise OutputError(
            f"{out} is there already.",
            "It may have been paid for: choose another with --out, or overwrite it with --force.",
        )
    check_writable(out)


def check_fitted(calibration: Calibration, out: Path | None) -> None:
    from qcompile.errors import CalibrationError

    if calibration.unfitted:
        where = "Nothing was kept" if out is None else f"The counts are in {out}"
        raise CalibrationError(f"Not everything could be fitted. {where}.", *calibration.unfitted)


def show_calibration(
    calibration: Calibration,
    values: dict[str, Any],
    out: Path | None,
    plot: Path | None,
    as_json: bool,
    found: Sequence[str] = (),
    paid: Sequence[str] = (),
) -> None:
    """Draw the calibration where it is wanted, and print it with the lines `found` and `paid`."""
    from qcompile.errors import CalibrationError
    from qcompile.mitigation.misfit import misfit_words
    from qcompile.output import write_file
    from qcompile.report.calibration import draw_calibration
    from qcompile.report.calibration_values import print_calibration

    if plot is not None:
        try:
            write_file(plot, draw_calibration(calibration))
        except KeyboardInterrupt:
            where = "" if out is None else f" The calibration is in {out}."
            raise CalibrationError(f"Interrupted: {plot} was not drawn.{where}") from None
    if as_json:
        echo_json(values)
        return
    print_calibration(values)
    written = [
        f"{what} in {path}" for what, path in (("calibration", out), ("picture", plot)) if path
    ]
    for line in (*misfit_words(values["calibration_misfits"]), *found, *written, *paid):
        click.echo(line)
