"""`qcompile plan`: what a policy costs on a machine, in each way to run it."""

from __future__ import annotations

import click

from qcompile.cli.options import (
    Positive,
    backend_option,
    echo_json,
    json_option,
    level_option,
    max_steps_option,
)
from qcompile.limits import (
    FREE_SECONDS,
    MAX_EPISODES,
    MAX_SHOTS,
    SECONDS_PER_EXECUTION,
    SECONDS_PER_JOB,
    USD_PER_SECOND,
)


@click.command("plan")
@click.argument("policy", default="lunarlander", metavar="[POLICY]")
@backend_option("ibm_lima")
@click.option(
    "--shots",
    type=click.IntRange(1, MAX_SHOTS),
    default=8192,
    show_default=True,
    help="Shots of each circuit.",
)
@click.option("--episodes", type=click.IntRange(1, MAX_EPISODES), default=1, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    default="readout",
    show_default=True,
    help="Its calibration is counted, but for the paper's way.",
)
@click.option(
    "--copies",
    type=click.IntRange(1, MAX_EPISODES),
    help="Episodes side by side on the device.  [default: as many as fit]",
)
@max_steps_option
@click.option(
    "--usd-per-second",
    type=Positive("dollars", zero=True),
    default=USD_PER_SECOND,
    show_default=True,
    help="Price of a QPU second beyond the free plan; a third party's figure.",
)
@click.option("--live", is_flag=True, help="Ask IBM for the machine's qubits; this spends nothing.")
@click.option("--account", help="With --live: account of IBM's own tools.")
@click.option("--instance", help="With --live: CRN or name.")
@json_option
def command(
    policy: str,
    backend: str,
    shots: int,
    episodes: int,
    seed: int,
    level: int,
    mitigation: str,
    copies: int | None,
    max_steps: int | None,
    usd_per_second: float,
    live: bool,
    account: str | None,
    instance: str | None,
    as_json: bool,
) -> None:
    """Say what episodes with POLICY (default lunarlander) cost on a machine, before anything is
    sent.

    The episodes are played on the backend's noise model first: they may last longer or shorter on
    the machine.
    """
    for option, value in (("--account", account), ("--instance", instance)):
        if value is not None and not live:
            raise click.UsageError(f"{option} is for --live.")
    from qcompile.errors import DeviceError
    from qcompile.execution import load_backend
    from qcompile.live.connection import Connection
    from qcompile.live.plan import copies_that_fit, forecast, strategies
    from qcompile.live.play import RunTask
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values
    from qcompile.report.tables import plural, print_table

    device = (
        Connection(backend, account, instance).device() if live else load_backend(backend).device
    )
    if device.is_ideal:
        raise DeviceError(
            "ideal is no machine: it costs nothing.",
            "Name a device; `qcompile backends` lists some.",
        )
    task = RunTask.model_validate(
        {
            "backend": device.name,
            "device": device,
            "policy": policy_values(load_policy(policy)),
            "shots": shots,
            "episodes": episodes,
            "seed": seed,
            "level": level,
            "mitigation": mitigation,
            "max_steps": max_steps,
            "copy_of": "episode",
        }
    )
    task = task.model_copy(update={"copies": copies or copies_that_fit(task)})
    forecasted = forecast(task)
    rows = [way.values(usd_per_second) for way in strategies(task, forecasted)]
    if as_json:
        echo_json(
            {
                "policy": task.policy.name,
                "backend": device.name,
                "shots": shots,
                "episodes": episodes,
                "copies": task.copies,
                "env_steps": forecasted.env_steps,
                "usd_per_second": usd_per_second,
                "free_seconds": FREE_SECONDS,
                "strategies": rows,
            }
        )
        return
    print_table(
        ["way", "jobs", "executions", "QPU seconds", "USD", "of free plan"],
        [
            [
                row["name"],
                f"{row['jobs']:,}",
                f"{row['executions']:,}",
                f"{row['qpu_seconds']:,.1f}",
                f"{row['price_usd']:,.0f}",
                f"{100 * row['share_of_free_plan']:,.0f} %",
            ]
            for row in rows
        ],
        f"{task.policy.name} on {device.name}: {plural(episodes, 'episode')}, {shots} shots, "
        f"{forecasted.env_steps} steps",
        right=range(1, 6),
        tight=True,
    )
    click.echo(
        f"seconds: IBM's published estimate, {SECONDS_PER_JOB:g} for a job and "
        f"{SECONDS_PER_EXECUTION:g} for an execution; the free plan has {FREE_SECONDS:g} in "
        f"28 days\nprice: {usd_per_second:g} USD a second\n"
        f"lockstep, {plural(task.copies or 1, 'episode')} side by side, is what `run --live` does; "
        "the twin plays any number of episodes"
    )
