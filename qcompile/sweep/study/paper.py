"""The paper's training study: its rows, and what the paper says of each (arXiv 2203.14348)."""

from __future__ import annotations

from dataclasses import replace

from qcompile.errors import StudyError
from qcompile.rl.presets import settings_for
from qcompile.sweep.study.rows import Claim, Row

FIGURES = {
    "cartpole": "CartPole-v1: the models of the paper, and ours",
    "reuse": "CartPole-v1: output reuse",
    "cartpole-v0": "CartPole-v0: one qubit, the paper's device circuit (a)",
    "acrobot": "Acrobot-v1: the models of the paper, and ours",
    "lunarlander": "LunarLander-v3: the models of the paper, and ours",
}
"""Figure by name: its title."""

_ENVIRONMENTS = {
    "cartpole": ("CartPole-v1", 475.0),
    "reuse": ("CartPole-v1", 475.0),
    "cartpole-v0": ("CartPole-v0", 195.0),
    "acrobot": ("Acrobot-v1", -90.0),
    "lunarlander": ("LunarLander-v3", 220.0),
}
_NONE = Claim("-")


def _row(
    figure: str,
    title: str,
    preset: str,
    model: str,
    claim: Claim = _NONE,
    *,
    seeds: int = 5,
    layout: str = "parallel",
    variant: str = "",
    target: float | None = None,
    **changes: object,
) -> Row:
    environment, usual = _ENVIRONMENTS[figure]
    settings = settings_for(preset, environment, model, layout).changed(**changes)
    name = "-".join(part for part in (figure, model, variant, preset) if part)
    wanted = usual if target is None else target
    return Row(name, title, figure, environment, preset, settings, seeds, wanted, claim)


def rows() -> list[Row]:
    """Every row of the study."""
    return [
        _row("cartpole", "SVQC", "paper", "svqc", Claim("about 150 to the maximum", 150)),
        _row("cartpole", "SVQC", "tuned", "svqc"),
        _row("cartpole", "surrogate", "paper", "surrogate"),
        _row("cartpole", "surrogate", "tuned", "surrogate"),
        _row(
            "cartpole",
            "MVQC",
            "paper",
            "mvqc",
            Claim("about 500, without reaching the maximum"),
        ),
        _row(
            "cartpole",
            "FCN, large",
            "paper",
            "fcn",
            Claim("about 400 to the maximum", 400),
            variant="large",
            episodes=800,
        ),
        _row("cartpole", "FCN", "tuned", "fcn"),
        _row(
            "cartpole",
            "FCN, small",
            "paper",
            "fcn",
            Claim("about 1,600 to the maximum", 1600),
            variant="small",
            hidden=(51,),
            episodes=2000,
        ),
        _row("cartpole", "CNN", "paper", "cnn", Claim("about 1,650 to the maximum", 1650)),
        *(
            _row("reuse", f"SVQC, reuse {reuse}", "paper", "svqc", variant=str(reuse), reuse=reuse)
            for reuse in (4, 8, 32)
        ),
        _row(
            "cartpole-v0",
            "SVQC, one qubit",
            "paper",
            "svqc",
            Claim("200.0 after training"),
            layout="single",
        ),
        _row("acrobot", "SVQC", "paper", "svqc", Claim("about 90", 90)),
        _row("acrobot", "SVQC", "tuned", "svqc"),
        _row(
            "acrobot",
            "SVQC, critic of circuits",
            "tuned",
            "svqc",
            variant="critic",
            critic_hidden=None,
            critic_lr=0.01,
        ),
        _row("acrobot", "surrogate", "paper", "surrogate"),
        _row("acrobot", "surrogate", "tuned", "surrogate"),
        _row(
            "acrobot",
            "FCN, large",
            "paper",
            "fcn",
            Claim("about 250", 250),
            variant="large",
            episodes=500,
        ),
        _row("acrobot", "FCN", "tuned", "fcn"),
        _row(
            "acrobot",
            "FCN, small",
            "paper",
            "fcn",
            Claim("about 600", 600),
            variant="small",
            hidden=(25,),
            episodes=900,
        ),
        _row("acrobot", "CNN", "paper", "cnn", Claim("about 1,000", 1000), episodes=1200),
        _row(
            "lunarlander",
            "SVQC",
            "paper",
            "svqc",
            Claim("average about 220 at 1,000, best of 10", 1000),
            seeds=10,
        ),
        _row("lunarlander", "SVQC", "tuned", "svqc", seeds=10),
        _row("lunarlander", "surrogate", "tuned", "surrogate"),
        _row(
            "lunarlander",
            "SVQC, serial",
            "paper",
            "svqc",
            layout="serial",
            variant="serial",
        ),
        _row(
            "lunarlander",
            "FCN, large",
            "paper",
            "fcn",
            Claim("average about 200 at 1,750", 1750),
            variant="large",
            target=200.0,
        ),
        _row("lunarlander", "FCN", "tuned", "fcn"),
    ]


def shown_in(row: Row, figure: str) -> bool:
    """Whether a row belongs into a figure: the SVQC of the paper is also a row of `reuse`."""
    return row.figure == figure or (figure == "reuse" and row.name == "cartpole-svqc-paper")


def rows_of(figures: tuple[str, ...]) -> list[Row]:
    """The rows of these figures, or all.

    Raises:
        StudyError: there is no such figure.
    """
    for figure in figures:
        if figure not in FIGURES:
            raise StudyError(f"Unknown figure {figure!r}.", f"Known: {', '.join(FIGURES)}.")
    chosen = figures or tuple(FIGURES)
    return [row for row in rows() if any(shown_in(row, figure) for figure in chosen)]


def shortened(row: Row, episodes: int) -> Row:
    """The row with at most so many episodes, for a first look."""
    fewest = min(episodes, row.settings.episodes or episodes)
    return replace(row, settings=row.settings.changed(episodes=fewest))
