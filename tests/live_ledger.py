"""What must hold of a live run whatever happens, by the ledger of the stand-in."""

from __future__ import annotations

import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from standin import Entry, StandIn

_ROUNDING_S = 1e-6
_DIRECTION_MARKS = frozenset(
    "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
)
_TOLD = ("qpu_seconds", "qpu_seconds_settled", "jobs_in_doubt", "jobs_uncharged")


def jobs_of(stand_in: StandIn, run: str) -> list[Entry]:
    """The jobs of a run, by their tags."""
    tag = f"qcompile-{run}-"
    return [job for job in stand_in.ledger().jobs if any(t.startswith(tag) for t in job.tags)]


def charged_s(jobs: Iterable[Entry]) -> float:
    return sum(job.charged_seconds for job in jobs)


def charged_of_steps(jobs: Iterable[Entry]) -> dict[int, list[float]]:
    """What was charged for the jobs of each number, those that cost nothing left out."""
    charged: dict[int, list[float]] = defaultdict(list)
    for job in jobs:
        number = int(max(job.tags, key=len).split("-")[-2])
        charged[number] += [job.charged_seconds] if job.charged_seconds else []
    return dict(charged)


def told_wrong(told: Mapping[str, Any], charged: float, limit_s: float) -> list[str]:
    """What is wrong with what a run tells of its charges, when the service had charged so much.

    No less is told than is charged; the limit holds, or else doubts were told.
    """
    wrong = [f"{key} is not told" for key in _TOLD if key not in told]
    upper = told["qpu_seconds"]
    settled = told.get("qpu_seconds_settled", upper)
    if not upper >= charged - _ROUNDING_S:
        wrong.append(f"told {upper:.2f} s where {charged:.2f} s are charged")
    if not 0 <= settled <= upper + _ROUNDING_S:
        wrong.append(f"settled {settled:.2f} s of {upper:.2f} s")
    if charged > limit_s + _ROUNDING_S and not told.get("jobs_in_doubt"):
        wrong.append(f"{charged:.2f} s charged with a limit of {limit_s:g} s and no doubt told")
    return wrong


def settled_wrong(told: Mapping[str, Any], charged: float) -> list[str]:
    """What is wrong with what is told once the service has told and listed everything."""
    expected = dict(zip(_TOLD, (charged, charged, 0, 0), strict=True))
    return [
        f"in the end {key} is {told.get(key)}, not {value:g}"
        for key, value in expected.items()
        if key not in told or abs(told[key] - value) > _ROUNDING_S
    ]


def words_wrong(words: str) -> list[str]:
    """What is wrong with the words of a command: what a user must never see."""
    wrong = ["a traceback"] if "Traceback (most recent call last)" in words else []
    marks = {c for c in words if c in _DIRECTION_MARKS}
    marks |= {c for c in words if unicodedata.category(c) == "Cc" and c not in "\n\t"}
    return wrong + [f"control characters: {sorted(map(ascii, marks))}"] * bool(marks)


def secrets_in(folder: Path, stand_in: StandIn) -> list[str]:
    """The files of a folder that hold the key of the account, or a token or a part of one."""
    secrets = [secret.encode() for secret in stand_in.secrets()]
    contents = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return [
        f"a secret in {path.relative_to(folder)}"
        for path, found in sorted(contents.items())
        if any(secret in found for secret in secrets)
    ]
