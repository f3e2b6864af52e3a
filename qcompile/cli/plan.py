"""`qcompile plan`: estimate what a policy costs on a machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import click

from qcompile.cli.options import (
    backend_option,
    echo_json,
    echo_note,
    env_option,
    import_option,
    json_option,
    level_option,
    max_steps_option,
)
from qcompile.cli.outputs import Outputs, output_options, report_option
from qcompile.cli.types import Integer, NamePath, Positive, Share, Shots
from qcompile.limits import (
    FREE_SECONDS,
    MAX_EPISODES,
    MAX_QPU_SECONDS,
    MAX_SHOTS,
    SECONDS_PER_EXECUTION,
    SECONDS_PER_JOB,
    USD_PER_SECOND,
)

_SECONDS = (
    f"QPU seconds: IBM's published estimate, {SECONDS_PER_JOB:g} per job and "
    f"{SECONDS_PER_EXECUTION:g} per execution; the free plan has {FREE_SECONDS:g} in 28 days"
)


def _one_or_several(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> str | list[str]:
    """The policies, by default lunarlander."""
    return [*values] if len(values) > 1 else next(iter(values), "lunarlander")


@click.command("plan")
@click.argument(
    "policy", type=NamePath(), nargs=-1, callback=_one_or_several, metavar="[POLICY]..."
)
@backend_option("ibm_lima")
@click.option(
    "--shots",
    type=Integer(1, MAX_SHOTS),
    help="Shots of each circuit.  [default: 8192; with --within the cheapest that fit]",
)
@click.option(
    "--episodes",
    type=Integer(1, MAX_EPISODES),
    default=1,
    show_default=True,
    help="Number of episodes.",
)
@click.option(
    "--seed",
    type=Integer(0),
    default=0,
    show_default=True,
    help="Episode i resets its environment with seed + i.",
)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    help="Errors to correct, as for `qcompile run`. The cost of calibrating first is counted, but "
    "not in the first row: the paper does not mitigate.  [default: readout, or what --calibration "
    "has]",
)
@click.option(
    "--calibration",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Mitigate with this file from `qcompile calibrate`, so that calibrating costs nothing.",
)
@click.option(
    "--calibration-shots",
    type=Shots("auto", "auto"),
    help="Shots of each circuit of the calibration. auto: as many as --shots needs.  [default: "
    "8192; with --within auto]",
)
@click.option(
    "--copies",
    type=Integer(1, MAX_EPISODES),
    help="Copies of the circuits on different qubits of the device, measured at once. Each copy "
    "plays another episode, or shares the shots with --split.  [default: as many as fit]",
)
@click.option(
    "--split/--no-split",
    default=None,
    help="Measure each decision on all copies at once, with a share of the shots on each.  "
    "[default: no; with --within whichever is cheaper]",
)
@max_steps_option
@click.option(
    "--within",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="Find the cheapest settings that need at most this many QPU seconds. Takes minutes.",
)
@click.option(
    "--keep",
    type=Share(),
    default=0.97,
    show_default=True,
    help="With --within: the share of the reward to keep. 0 is the reward of random actions, 1 "
    "that of the policy without noise.",
)
@output_options("the QPU seconds of each way, or with --within reward against seconds", "plan")
@import_option
@env_option
@click.option(
    "--usd-per-second",
    type=Positive("dollars", zero=True),
    default=USD_PER_SECOND,
    show_default=True,
    help="Price of a QPU second beyond the free plan. The default comes from a third party, not "
    "from IBM.",
)
@click.option(
    "--live", is_flag=True, help="Read the machine's qubits from IBM. This spends no QPU time."
)
@click.option("--account", help="With --live: name of an account saved with qiskit-ibm-runtime.")
@click.option("--instance", help="With --live: CRN or name of an IBM instance.")
@report_option
@json_option
def command(
    policy: str | list[str],
    backend: str,
    shots: int | None,
    episodes: int,
    seed: int,
    level: int,
    mitigation: str | None,
    calibration: Path | None,
    calibration_shots: int | Literal["auto"] | None,
    copies: int | None,
    split: bool | None,
    max_steps: int | None,
    within: float | None,
    keep: float,
    imports: tuple[str, ...],
    env: dict[str, Any],
    usd_per_second: float,
    live: bool,
    account: str | None,
    instance: str | None,
    as_json: bool,
    outputs: Outputs,
) -> None:
    """Estimate what episodes with POLICY (default lunarlander) cost on a machine. Nothing is sent.

    The episodes are played on the backend's noise model; on the machine they may be longer or
    shorter. Without --within, the table compares four ways to run them: from one job per circuit,
    as in the paper, to a single calibration after which the episodes are simulated.

    With --within, the table shows the cheapest settings that keep the reward, and the command that
    plays with them. Several policies can be compared.
    """
    from qcompile.policy.decision import hold_text
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
        calibration=calibration,
        calibration_shots=calibration_shots,
        copies=copies,
        split=split,
        max_steps=max_steps,
        within=within,
        keep=keep,
        imports=imports,
        env=env,
        usd_per_second=usd_per_second,
        live=live,
        account=account,
        instance=instance,
        on_note=echo_note,
    )
    values, table = planned.to_dict(), planned.table()
    if as_json:
        echo_json(values)
    elif within is None:
        steps = f"{values['env_steps']} steps"
        if values["hold"] > 1:
            decisions = plural(values["decisions"], "decision")
            steps = f"{decisions}, each {hold_text(values['hold'])}"
        print_table(
            table.header,
            table.words,
            f"{values['policy']} on {values['backend']}: {plural(episodes, 'episode')}, "
            f"{values['shots']} shots, {steps}",
            right=range(1, 6),
            tight=True,
        )
        click.echo(
            f"{_SECONDS}\nUSD: {usd_per_second:g} per QPU second\n"
            "packed: all circuits of a decision in one job\n"
            f"lockstep: all episodes step together, {values['copies']} at a time on the device, "
            "with one job per step\n"
            "calibrate, play twin: measure the device once, then play any number of episodes "
            "offline\n"
            "To find cheaper settings that keep the reward, add --within SECONDS."
        )
    else:
        title = (
            f"{plural(episodes, 'episode')} on {values['backend']} within {within:g} QPU seconds"
        )
        right = range(len(table.columns))
        print_table(table.header, table.words, title, right=right, tight=True)
        click.echo(
            f"{_SECONDS}\nahead: most decisions of an episode in one job (--speculate)\n"
            "at 4 sub-jobs: QPU seconds if IBM counts each job as four (unknown)\n"
            f"mean reward: {values['scored_episodes']} whole episodes on a model of the machine, "
            "more for the recommended settings\n"
            f"kept: 0 % is the reward of random actions, {values['random_reward']:.4g}; "
            f"100 % that without noise, {values['ideal_reward']:.4g}"
        )
        if planned.recommended is not None:
            click.echo(planned.remark)
    outputs.save(planned, planned.check_fits)
