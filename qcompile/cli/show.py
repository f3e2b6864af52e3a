"""`qcompile show`: circuits before and after compilation, or the layers of a network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from qcompile.cli.options import backend_option, echo_json, echo_note, json_option, level_option
from qcompile.cli.types import Integer, OutputPath
from qcompile.output import check_writable, write_file

if TYPE_CHECKING:
    from qcompile.policy import Network


@click.command("show")
@click.argument("subject", metavar="[POLICY|FILE.qasm]", default="lunarlander")
@backend_option()
@level_option
@click.option(
    "--surrogate",
    is_flag=True,
    help="Show the linear softmax policy that the circuits compute instead, term by term.",
)
@click.option(
    "--draw",
    type=OutputPath(".txt", ".svg", ".tex"),
    help="Draw the circuits before and after compilation, one of each kind; .txt, .svg or .tex "
    "(quantikz), overwritten.",
)
@click.option(
    "--circuit",
    type=Integer(0),
    metavar="N",
    help="With --draw: draw only circuit N.",
)
@click.option(
    "--map",
    "map_file",
    type=OutputPath(".png", ".svg", ".pdf"),
    help="Draw the qubits and couplings of the backend by their errors, those in use marked; "
    ".png, .svg or .pdf, overwritten.",
)
@click.option(
    "--style",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.mplstyle",
    help="Fonts, sizes and colours of --map: a matplotlib style file.",
)
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    subject: str,
    backend: str,
    level: int,
    surrogate: bool,
    draw: Path | None,
    circuit: int | None,
    map_file: Path | None,
    style: Path | None,
    as_json: bool,
) -> None:
    """Show the circuits of a policy or an OpenQASM file, before and after compilation.

    The default policy is lunarlander. Trained angles are shown as symbols; `run` and `export` fill
    in the numbers. On a device, the qubits chosen for each circuit are shown, and why. For a policy
    that is a neural network, its layers are shown.
    """
    if circuit is not None and draw is None:
        raise click.UsageError("--circuit needs --draw.")
    if style is not None and map_file is None:
        raise click.UsageError("--style needs --map.")
    if surrogate:
        _check_surrogate(ctx, subject)
        _show_surrogate(subject, as_json)
        return
    from qcompile.execution import load_backend
    from qcompile.passes import compile
    from qcompile.policy import Network, load_policy
    from qcompile.report.device_map import draw_executable_map
    from qcompile.report.drawing import draw_executable, form_of
    from qcompile.report.wires import executable_values, print_executable

    form = None if draw is None else form_of(draw)
    _check_files({"--draw": draw, "--map": map_file}, subject, backend, style)
    policy = None if Path(subject).suffix == ".qasm" else load_policy(subject)
    if isinstance(policy, Network):
        _show_network(ctx, policy, as_json)
        return

    opened = load_backend(backend)
    device = opened.device
    if policy is None:
        from qcompile.jobs.program_file import compile_source
        from qcompile.qasm.read import read_file

        importance = None
        compiled = compile_source(read_file(subject), device, level, "3")
        executable, numbers = compiled.executable, compiled.circuits
    else:
        numbers, importance = None, policy.importance
        executable = compile(policy.program, device, level, importance)
    values = executable_values(
        executable, importance, numbers, policy=policy, calibration=opened.calibration
    )
    written: dict[Path, tuple[str, bytes]] = {}
    if draw is not None and form is not None:
        drawn = draw_executable(executable, form, circuit, numbers=numbers)
        written[draw] = ("drawing", drawn.encode())
    if map_file is not None:
        name = Path(subject).name if policy is None else policy.name
        figure = draw_executable_map(executable, style, f"{name} on {opened.name}")
        written[map_file] = ("map", figure.contents(map_file.suffix))
    if as_json:
        echo_json(values)
    else:
        print_executable(executable, values)
    for path, (what, contents) in written.items():
        write_file(path, contents)
        echo_note(f"{what} written to {path}")


def _check_files(
    writes: Mapping[str, Path | None], subject: str, backend: str, style: Path | None
) -> None:
    """Check that files can be written and overwrite nothing that is read, nor each other.

    Raises:
        OptionError: two are one file.
        OutputError: one cannot be written.
    """
    if not any(writes.values()):
        return
    from qcompile.clashes import check_clashes
    from qcompile.device import backend_path
    from qcompile.policy.files import policy_path

    reads = {subject: policy_path(subject), "--backend": backend_path(backend), "--style": style}
    check_clashes(reads, writes)
    for path in writes.values():
        if path is not None:
            check_writable(path)


def _check_surrogate(ctx: click.Context, subject: str) -> None:
    """Raise click.UsageError if --surrogate is combined with something that it excludes."""
    if Path(subject).suffix == ".qasm":
        raise click.UsageError(
            f"--surrogate needs a policy; {subject} is a program, without encoder and head.", ctx
        )
    for name in _circuit_options(ctx):
        raise click.UsageError(
            f"--surrogate and {name} cannot be combined: nothing is compiled.", ctx
        )


def _circuit_options(ctx: click.Context) -> list[str]:
    """The options given that apply only to circuits."""
    default = ParameterSource.DEFAULT
    names = {"backend": "backend", "level": "level", "draw": "draw", "map": "map_file"}
    return [
        f"--{name}"
        for name, parameter in names.items()
        if ctx.get_parameter_source(parameter) is not default
    ]


def _show_network(ctx: click.Context, network: Network, as_json: bool) -> None:
    from qcompile.deploy.network import refuse_options
    from qcompile.report.network import network_values, print_network

    refuse_options(network, _circuit_options(ctx))
    values = network_values(network)
    if as_json:
        echo_json(values)
    else:
        print_network(values)


def _show_surrogate(subject: str, as_json: bool) -> None:
    from qcompile.policy import load_circuits
    from qcompile.policy.surrogate import Surrogate
    from qcompile.report.surrogate import print_surrogate, surrogate_values

    surrogate = Surrogate.of(load_circuits(subject))
    if as_json:
        echo_json(surrogate_values(surrogate))
    else:
        print_surrogate(surrogate)
