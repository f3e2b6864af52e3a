"""All known troubles of a service, by name, for tests and benchmarks/chaos.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from .answers import CHARGES, LIST, METRICS, SHAPES, SUBMIT, Reshape
from .faults import ACCEPTED_STATUS, OF_RESULTS, Fault
from .stand_in import StandIn

HOSTILE = (
    "\x1b[31m\x1b]0;title\x07 \u202egnp.exe\u202c \u2066x\u2069 \u200f\u200e \x9b2J \rgone\x08"
)
"""Escape codes, both their eight-bit forms, and marks that turn the direction of text."""
LATE_S = 2.0
LONG_S = 3600.0


@dataclass(frozen=True)
class Trouble:
    """A trouble, from `begin` to `StandIn.recover`, and what must still hold for a run.

    In any case nothing is lost, and no charge goes unreported. `finishes`: the run needs nobody to
    resume it. `paid_once`: no step is charged twice (a job that is gone, or that failed and was
    charged, is sent again when somebody resumes). `neighbours`: the account has jobs of other runs.
    `options` are for the command line. `limit_s` is a tight one.
    """

    name: str
    begin: Callable[[StandIn], None]
    finishes: bool = False
    paid_once: bool = True
    neighbours: bool = False
    options: tuple[str, ...] = ()
    limit_s: float | None = None


def _lost(stand_in: StandIn, probability: float = 0.5, kind: Fault = Fault.ACCEPTED_504) -> None:
    """Answers to accepted jobs are lost, so that they have to be looked for."""
    stand_in.faults.chance(kind, probability, on=SUBMIT)


def _late(stand_in: StandIn, kind: Fault, probability: float, lag_s: float) -> None:
    _lost(stand_in, probability, kind)
    stand_in.faults.listing_lag_seconds = lag_s


def _once_late(stand_in: StandIn) -> None:
    stand_in.faults.once(Fault.ACCEPTED_504, on=SUBMIT)
    stand_in.faults.listing_lag_seconds = LONG_S


def _refused_late(stand_in: StandIn) -> None:
    stand_in.faults.once(Fault.ACCEPTED_400, on=SUBMIT)
    stand_in.faults.listing_lag_seconds = LATE_S


def _chance(kind: Fault, probability: float, on: str | None, stand_in: StandIn) -> None:
    stand_in.faults.chance(kind, probability, on=on)


def _tags(kind: Fault, stand_in: StandIn) -> None:
    _lost(stand_in)
    stand_in.faults.chance(kind, 1.0, on=LIST)


def _shape(rule: Reshape, stand_in: StandIn) -> None:
    if rule.on == LIST:
        _lost(stand_in)
    stand_in.faults.reshape(rule)


def _charges(lag_s: float, stand_in: StandIn) -> None:
    stand_in.settings.usage_lag_seconds = lag_s


def _failures(kind: Fault, stand_in: StandIn) -> None:
    stand_in.faults.chance(kind, 0.3)


def _no_reasons(stand_in: StandIn) -> None:
    stand_in.faults.chance(Fault.JOB_FAILS, 0.3)
    stand_in.faults.chance(Fault.REASON_MISSING, 1.0)


def _echoes(kind: Fault, stand_in: StandIn) -> None:
    stand_in.faults.echo_secrets = True
    stand_in.faults.chance(kind, 0.15)
    stand_in.faults.chance(Fault.ACCEPTED_400, 0.3, on=SUBMIT)


def _hostile(stand_in: StandIn) -> None:
    stand_in.faults.suffix = HOSTILE
    stand_in.faults.chance(Fault.JOB_FAILS, 0.3)
    stand_in.faults.chance(Fault.ACCEPTED_403, 0.3, on=SUBMIT)
    stand_in.faults.chance(Fault.NOT_FOUND, 0.2, on="GET /jobs/{id}")


def _at_random(stand_in: StandIn) -> None:
    """A little of everything that ends on its own."""
    faults = stand_in.faults
    for kind in (Fault.RATE_LIMITED, Fault.SERVER_ERROR, Fault.BAD_GATEWAY, Fault.UNAVAILABLE):
        faults.chance(kind, 0.02)
    for kind in (Fault.GATEWAY_TIMEOUT, Fault.DROPPED, Fault.CUT_ANSWER):
        faults.chance(kind, 0.02)
    for kind in (Fault.ACCEPTED_504, Fault.ACCEPTED_DROPPED, Fault.ACCEPTED_400):
        faults.chance(kind, 0.1, on=SUBMIT)
    for kind in (Fault.JOB_FAILS, Fault.JOB_CANCELLED, Fault.JOB_WAITS, *OF_RESULTS):
        faults.chance(kind, 0.05)
    faults.wait_seconds, faults.listing_lag_seconds = 1.0, 0.2
    stand_in.settings.usage_lag_seconds = 0.3
    faults.expire_tokens()


_ENDURED = ("list: a count below", "list: no created", "job: no created", "metrics: ", "results: ")
"""Shapes that do not stop a run: what it needs is there, or comes when it is asked for again."""

_ALL = (
    Trouble(
        "late: 504, 60 % lost",
        partial(_late, kind=Fault.ACCEPTED_504, probability=0.6, lag_s=LATE_S),
        paid_once=False,
        limit_s=30.0,
    ),
    Trouble(
        "late: dropped, 40 % lost",
        partial(_late, kind=Fault.ACCEPTED_DROPPED, probability=0.4, lag_s=LATE_S),
        paid_once=False,
        limit_s=30.0,
    ),
    Trouble(
        "late: cut off, 40 % lost",
        partial(_late, kind=Fault.CUT_ANSWER, probability=0.4, lag_s=LATE_S),
        paid_once=False,
    ),
    Trouble("late: listed after the end", _once_late, finishes=True, paid_once=False),
    Trouble("late: refused, then listed", _refused_late, paid_once=False),
    *(
        Trouble(f"lost: {kind}", partial(_lost, kind=kind), finishes=True)
        for kind in (Fault.ACCEPTED_504, Fault.ACCEPTED_DROPPED, Fault.CUT_ANSWER)
    ),
    *(
        Trouble(f"refused: {kind}", partial(_chance, kind, 0.5, SUBMIT))
        for kind, status in ACCEPTED_STATUS.items()
        if status < 500
    ),
    Trouble("tags: ignored", partial(_tags, Fault.TAGS_IGNORED), neighbours=True),
    Trouble("tags: ignored and hidden", partial(_tags, Fault.TAGS_HIDDEN), neighbours=True),
    *(
        Trouble(f"shape: {name}", partial(_shape, rule), finishes=name.startswith(_ENDURED))
        for name, rule in SHAPES.items()
    ),
    *(Trouble(name, partial(_shape, rule), finishes=True) for name, rule in CHARGES.items()),
    Trouble("charge: told late", partial(_charges, 1.5), finishes=True),
    Trouble("charge: never told", partial(_charges, LONG_S), finishes=True),
    Trouble("charge: metrics 404", partial(_chance, Fault.NOT_FOUND, 1.0, METRICS), finishes=True),
    Trouble("failed: uncharged", partial(_failures, Fault.JOB_FAILS)),
    Trouble("failed: charged", partial(_failures, Fault.JOB_FAILS_CHARGED), paid_once=False),
    Trouble("failed: no reason", _no_reasons),
    Trouble("cancelled", partial(_failures, Fault.JOB_CANCELLED)),
    Trouble(
        "secrets: 404", partial(_echoes, Fault.NOT_FOUND), paid_once=False, options=("--traceback",)
    ),
    Trouble("secrets: 500", partial(_echoes, Fault.SERVER_ERROR), options=("--traceback",)),
    Trouble("text: escape codes", _hostile, paid_once=False),
    Trouble("at random", _at_random),
)
TROUBLES = {trouble.name: trouble for trouble in _ALL}
