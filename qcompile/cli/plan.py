"""`qcompile plan`: what a policy costs on a machine, in each way to run it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import click

from qcompile.cli.options import (
    Positive,
    Share,
    Shots,
    backend_option,
    echo_json,
    echo_note,
    env_option,
    import_option,
    json_option,
    level_option,
    max_steps_option,
)
from qcompile.cli.outputs import Outputs, output_options
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
    f"seconds: IBM's published estimate, {SECONDS_PER_JOB:g} for a job and "
    f"{SECONDS_PER_EXECUTION:g} for an execution; the free plan has {FREE_SECONDS:g} in 28 days"
)


def _one_or_several(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> str | list[str]:
    """The policies; the usual one where none is named."""
    return [*values] if len(values) > 1 else next(iter(values), "lunarlander")


@click.command("plan")
@click.argument("policy", nargs=-1, callback=_one_or_several, metavar="[POLICY]...")
@backend_option("ibm_lima")
@click.option(
    "--shots",
    type=click.IntRange(1, MAX_SHOTS),
    help="Shots of each circuit.  [default: 8192; with --within they are found]",
)
@click.option("--episodes", type=click.IntRange(1, MAX_EPISODES), default=1, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@level_option
@click.option(
    "--mitigation",
    type=click.Choice(["none", "readout", "response"]),
    help="What is mitigated; its calibration is counted, except in the paper's way.  [default: "
    "readout, or that of the calibration]",
)
@click.option(
    "--calibration",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Mitigate with this file of `qcompile calibrate`: no calibration is counted.",
)
@click.option(
    "--calibration-shots",
    type=Shots("auto", "auto"),
    help="Shots of the calibration, or auto.  [default: 8192; with --within auto]",
)
@click.option(
    "--copies",
    type=click.IntRange(1, MAX_EPISODES),
    help="Copies of the circuits side by side on the device: one for each episode, or --split. "
    " [default: as many as fit]",
)
@click.option(
    "--split/--no-split",
    default=None,
    help="Measure each decision in all copies, with a share of the shots in each.  [default: no; "
    "with --within whichever is cheaper]",
)
@max_steps_option
@click.option(
    "--within",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="Find the cheapest settings that stay within this number of QPU seconds; takes minutes.",
)
@click.option(
    "--keep",
    type=Share(),
    default=0.97,
    show_default=True,
    help="With --within: the share of the policy's reward that must be left; 0 is what random "
    "actions earn, 1 what it earns without noise.",
)
@output_options("the QPU seconds of each way, or with --within reward against seconds")
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
    """Say what episodes with POLICY (default lunarlander) cost on a machine, before anything is
    sent.

    The episodes are played on the backend's noise model first: they may last longer or shorter on
    the machine. With --within the cheapest settings are found that keep the reward, among those of
    several policies too, and the command that plays them.
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
            steps = f"{decisions}, each {held_words(values['hold'])}"
        print_table(
            table.header,
            table.words,
            f"{values['policy']} on {values['backend']}: {plural(episodes, 'episode')}, "
            f"{values['shots']} shots, {steps}",
            right=range(1, 6),
            tight=True,
        )
        click.echo(
            f"{_SECONDS}\nprice: {usd_per_second:g} USD a second\n"
            f"lockstep: {plural(values['copies'], 'episode')} side by side, a job for each "
            "decision; the twin plays any number of episodes\n"
            "cheaper: --within SECONDS finds settings that fit and keep the reward"
        )
    else:
        title = (
            f"{plural(episodes, 'episode')} on {values['backend']} within {within:g} QPU seconds"
        )
        right = range(len(table.columns))
        print_table(table.header, table.words, title, right=right, tight=True)
        click.echo(
            f"{_SECONDS}\nahead: decisions of an episode in a job, at most (--speculate)\n"
            f"at 4 sub-jobs: should IBM count a job as four, which is not known\n"
            f"rewards: of {values['judged_episodes']} whole episodes on a model of the machine, "
            "more for what is recommended; kept is their share between random actions, "
            f"{values['random_reward']:.4g}, and no noise, {values['ideal_reward']:.4g}"
        )
        if planned.recommended is not None:
            click.echo(planned.remark)
    outputs.save(planned, quiet=as_json)
    planned.check_fits()
