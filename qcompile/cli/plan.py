"""`qcompile plan`: what a policy costs on a machine, in each way to run it."""

from __future__ import annotations

from typing import Any

import click

from qcompile.cli.options import (
    Positive,
    backend_option,
    echo_json,
    env_option,
    import_option,
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
@import_option
@env_option
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
    imports: tuple[str, ...],
    env: dict[str, Any],
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
    from qcompile.policy.decision import held_words
    from qcompile.report.tables import plural, print_table
    from qcompile.verbs.plan import plan

    planned = plan(
        policy,
        backend,
        shots=shots,
        episodes=episodes,
        seed=seed,
        level=level,
        mitigation=mitigation,
        copies=copies,
        max_steps=max_steps,
        imports=imports,
        env=env,
        usd_per_second=usd_per_second,
        live=live,
        account=account,
        instance=instance,
    )
    values = planned.to_dict()
    if as_json:
        echo_json(values)
        return
    steps = f"{values['env_steps']} steps"
    if values["hold"] > 1:
        decisions = plural(values["decisions"], "decision")
        steps = f"{decisions}, each {held_words(values['hold'])}"
    print_table(
        *planned.table,
        f"{values['policy']} on {values['backend']}: {plural(episodes, 'episode')}, {shots} shots, "
        f"{steps}",
        right=range(1, 6),
        tight=True,
    )
    click.echo(
        f"seconds: IBM's published estimate, {SECONDS_PER_JOB:g} for a job and "
        f"{SECONDS_PER_EXECUTION:g} for an execution; the free plan has {FREE_SECONDS:g} in "
        f"28 days\nprice: {usd_per_second:g} USD a second\n"
        f"lockstep, {plural(values['copies'], 'episode')} side by side, is what `run --live` does; "
        "the twin plays any number of episodes"
    )
