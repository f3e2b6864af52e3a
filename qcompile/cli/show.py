"""`qcompile show`: circuits before and after compilation, or the layers of a network."""

from __future__ import annotations

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
    as_json: bool,
) -> None:
    """Show the circuits of a policy or an OpenQASM file, before and after compilation.

    The default policy is lunarlander. Trained angles are shown as symbols; `run` and `export` fill
    in the numbers. On a device, the qubit chosen for each circuit is shown, and why. For a policy
    that is a neural network, its layers are shown.
    """
    if circuit is not None and draw is None:
        raise click.UsageError("--circuit needs --draw.")
    if surrogate:
        _check_surrogate(ctx, subject)
        _show_surrogate(subject, as_json)
        return
    from qcompile.execution import load_backend
    from qcompile.passes import compile
    from qcompile.policy import Network, load_policy
    from qcompile.report.drawing import draw_executable, form_of
    from qcompile.report.wires import executable_values, print_executable

    form = None if draw is None else form_of(draw)
    if draw is not None:
        _check_file(draw, subject, backend)
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
        policy.program.require_narrow("show")
        numbers, importance = None, policy.importance
        executable = compile(policy.program, device, level, importance)
    values = executable_values(
        executable, importance, numbers, policy=policy, calibration=opened.calibration
    )
    drawn = ""
    if form is not None:
        drawn = draw_executable(executable, form, circuit, numbers=numbers)
    if as_json:
        echo_json(values)
    else:
        print_executable(executable, values)
    if draw is not None:
        write_file(draw, drawn.encode())
        echo_note(f"drawing written to {draw}")


def _check_file(draw: Path, subject: str, backend: str) -> None:
    """Check that the drawing can be written and overwrites nothing that is shown.

    Raises:
        OptionError: it is the file of the subject or of the backend.
        OutputError: it cannot be written.
    """
    from qcompile.clashes import check_clashes
    from qcompile.device import backend_path
    from qcompile.policy.files import policy_path

    reads = {subject: policy_path(subject), "--backend": backend_path(backend)}
    check_clashes(reads, {"--draw": draw})
    check_writable(draw)


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
    return [
        f"--{name}"
        for name in ("backend", "level", "draw")
        if ctx.get_parameter_source(name) is not default
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
