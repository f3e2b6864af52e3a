"""`qcompile compile`: compile an OpenQASM file to a device's native gates."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from qcompile.cli.options import backend_option, echo_json, json_option, level_option


@click.command("compile")
@click.argument("file", metavar="FILE.qasm", type=click.Path(dir_okay=False, path_type=Path))
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
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write, overwritten.  [default: standard output]",
)
@json_option
def command(
    file: Path,
    backend: str,
    level: int,
    format: Literal["qasm3", "qasm2"],
    output: Path | None,
    as_json: bool,
) -> None:
    """Compile an OpenQASM 2 or 3 program to a backend's native gates.

    On a device, the qubits with the lowest error are used first, and OpenQASM 3 names them. Qubits
    that gates connect are placed on coupled ones by Qiskit, which inserts swaps where it must.
    Physical qubits named in the program are kept. Qubits without gates and measurements are left
    out.
    """
    from qcompile.clashes import check_clashes
    from qcompile.device import backend_path
    from qcompile.execution import open_device
    from qcompile.jobs.program_file import compile_source
    from qcompile.output import write_file
    from qcompile.qasm.read import read_file
    from qcompile.report.wires import executable_values

    check_clashes({"FILE": file, "--backend": backend_path(backend)}, {"--output": output})
    version: Literal["3", "2"] = "3" if format == "qasm3" else "2"
    compiled = compile_source(read_file(file), open_device(backend), level, version)
    if output is not None:
        write_file(output, compiled.text.encode())
    if as_json:
        text = compiled.text if output is None else None
        values = executable_values(compiled.executable, numbers=compiled.circuits)
        echo_json(values | {"text": text})
    elif output is None:
        click.echo(compiled.text, nl=False)
    else:
        before = sum(map(len, compiled.executable.source.circuits))
        after = sum(map(len, compiled.executable.native.circuits))
        click.echo(f"{before} gates became {after} native gates at level {level} in {output}")
    for note in compiled.notes:
        click.echo(f"note: {note}", err=True)
