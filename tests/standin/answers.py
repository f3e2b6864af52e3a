"""Answers of the wrong shape: valid JSON that does not match the service's reference."""

from __future__ import annotations

import math
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

LIST, JOB, SUBMIT = "GET /jobs", "GET /jobs/{id}", "POST /jobs"
RESULTS, METRICS = "GET /jobs/{id}/results", "GET /jobs/{id}/metrics"
CHARGE = ("usage", "qpu_charge_time_seconds")
EVERY = "*"
"""In a path: each item of a list."""

Path = tuple[str | int, ...]


class Reshape(BaseModel):
    """Answers to `on` requests get the value `to` at a path, or lose it with `drop`.

    The path () is the whole answer. `times` answers are changed; None changes all of them.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")

    on: str
    at: Path = ()
    to: Any = None
    drop: bool = False
    times: int | None = Field(default=None, ge=1)


SHAPES: dict[str, Reshape] = {
    "submitted: a list": Reshape(on=SUBMIT, to=["accepted"], times=2),
    "submitted: null": Reshape(on=SUBMIT, times=2),
    "submitted: no id": Reshape(on=SUBMIT, at=("id",), drop=True, times=2),
    "submitted: a number as id": Reshape(on=SUBMIT, at=("id",), to=17, times=2),
    "list: a list": Reshape(on=LIST, to=[], times=2),
    "list: null": Reshape(on=LIST, times=2),
    "list: no jobs": Reshape(on=LIST, at=("jobs",), drop=True, times=2),
    "list: an object of jobs": Reshape(on=LIST, at=("jobs",), to={"0": None}, times=2),
    "list: rows of null": Reshape(on=LIST, at=("jobs", EVERY), times=2),
    "list: rows of text": Reshape(on=LIST, at=("jobs", EVERY), to="job", times=2),
    "list: no count": Reshape(on=LIST, at=("count",), drop=True, times=2),
    "list: a count in words": Reshape(on=LIST, at=("count",), to="one", times=2),
    "list: a count above the rows": Reshape(on=LIST, at=("count",), to=10**6),
    "list: a count below the rows": Reshape(on=LIST, at=("count",), to=0),
    "list: no id": Reshape(on=LIST, at=("jobs", EVERY, "id"), drop=True, times=2),
    "list: no tags": Reshape(on=LIST, at=("jobs", EVERY, "tags"), drop=True, times=2),
    "list: tags in one text": Reshape(on=LIST, at=("jobs", EVERY, "tags"), to="qcompile", times=2),
    "list: no created": Reshape(on=LIST, at=("jobs", EVERY, "created"), drop=True),
    "list: a number as created": Reshape(on=LIST, at=("jobs", EVERY, "created"), to=5, times=2),
    "job: a list": Reshape(on=JOB, to=[], times=3),
    "job: null": Reshape(on=JOB, times=3),
    "job: no state": Reshape(on=JOB, at=("state",), drop=True, times=3),
    "job: a text as state": Reshape(on=JOB, at=("state",), to="Completed", times=3),
    "job: a number as status": Reshape(on=JOB, at=("state", "status"), to=3, times=3),
    "job: an unknown status": Reshape(on=JOB, at=("state", "status"), to="Thinking", times=3),
    "job: no id": Reshape(on=JOB, at=("id",), drop=True, times=3),
    "job: no created": Reshape(on=JOB, at=("created",), drop=True),
    "results: a list": Reshape(on=RESULTS, to=[1], times=2),
    "results: a number": Reshape(on=RESULTS, to=5, times=2),
    "results: null": Reshape(on=RESULTS, times=2),
    "metrics: a list": Reshape(on=METRICS, to=[], times=2),
    "metrics: null": Reshape(on=METRICS, times=2),
    "metrics: a list of usage": Reshape(on=METRICS, at=("usage",), to=[2.0], times=2),
    "metrics: no usage": Reshape(on=METRICS, at=("usage",), drop=True, times=2),
    "batch: a list": Reshape(on="POST /sessions", to=[], times=1),
    "batch: no id": Reshape(on="POST /sessions", at=("id",), drop=True, times=1),
    "usage: a list": Reshape(on="GET /instances/usage", to=[]),
    "usage: words": Reshape(
        on="GET /instances/usage", at=("usage_limit_seconds",), to="much", times=1
    ),
    "usage: null": Reshape(on="GET /instances/usage", times=1),
    "backends: a list": Reshape(on="GET /backends", to=[], times=1),
    "backends: null": Reshape(on="GET /backends", at=("devices",), times=1),
    "backends: no names": Reshape(
        on="GET /backends", at=("devices", EVERY, "name"), drop=True, times=1
    ),
    "configuration: a list": Reshape(on="GET /backends/{id}/configuration", to=[], times=1),
    "configuration: no qubits": Reshape(
        on="GET /backends/{id}/configuration", at=("n_qubits",), drop=True, times=1
    ),
    "properties: a text": Reshape(on="GET /backends/{id}/properties", to="none", times=1),
    "properties: null": Reshape(on="GET /backends/{id}/properties", at=("qubits",), times=1),
    "token: a list": Reshape(on="POST /identity/token", to=[], times=1),
    "token: a number": Reshape(on="POST /identity/token", at=("access_token",), to=5, times=1),
}
"""Most of them end after some answers, as an upgrade of a service that goes wrong and is mended."""

CHARGES: dict[str, Reshape] = {
    f"charge: {name}": Reshape(on=METRICS, at=CHARGE, to=value)
    for name, value in {
        "negative": -5.0,
        "not a number": math.nan,
        "infinite": math.inf,
        "huge": 1e300,
        "words": "two",
        "null": None,
        "true": True,
        "a list": [2.0],
    }.items()
}
"""Charges that no job can have had."""


def reshaped(answer: Any, rule: Reshape) -> tuple[Any, bool]:
    """The answer changed by a rule, and whether that changed anything."""
    if not rule.at:
        return rule.to, True
    changed = _change(answer, rule.at, rule)
    return answer, changed


def _change(within: Any, at: Path, rule: Reshape) -> bool:
    """Change the value at a path in place; False if there is no such path."""
    first, rest = at[0], at[1:]
    if first == EVERY:
        places: list[Any] = list(range(len(within))) if isinstance(within, list) else []
    else:
        places = [first] if isinstance(within, dict) and first in within else []
    if rest:
        return sum(_change(within[place], rest, rule) for place in places) > 0
    for place in places:
        if rule.drop:
            del within[place]
        else:
            within[place] = rule.to
    return bool(places)
