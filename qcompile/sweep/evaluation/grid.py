"""A grid is policies x backends x shots x mitigations x levels; a cell is one of each."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from qcompile.device import IDEAL, IDEAL_NAME
from qcompile.errors import StudyError
from qcompile.execution import Backend, DeviceBackend
from qcompile.output import file_name
from qcompile.policy import AnyPolicy, Network
from qcompile.policy.files import policy_values
from qcompile.sweep.evaluation.calibrations import CalibrationFile, by_device, check_needed

Combination = tuple[Backend, int | None, str, int]
"""Backend, shots, mitigation and level."""

REFERENCE = (IDEAL_NAME, None, "none", 2)
"""The combination, its backend by name, that the others of a policy are compared with."""


@dataclass(frozen=True, eq=False)
class Cell:
    """A policy on a backend, with all that its rewards depend on; `shots` None is exact.

    Episode i resets with `seed` + i, in every cell alike. `calibration` is what mitigates; without
    it a twin takes its own and any other backend is measured first. `greedy` takes the likeliest
    action instead of sampling.
    """

    policy: AnyPolicy
    backend: Backend
    shots: int | None
    mitigation: str
    level: int
    episodes: int
    seed: int
    calibration: CalibrationFile | None = None
    greedy: bool = False

    @property
    def name(self) -> str:
        """The name of its file: unlike that of any other cell of a grid."""
        shots = "exact" if self.shots is None else self.shots
        greedy = "-greedy" if self.greedy else ""
        by = f"-by-{_sha256(self.calibration.contents)[:8]}" if self.calibration else ""
        return (
            f"{file_name(self.policy.name)}-{file_name(self.backend.name)}-{shots}"
            f"-{self.mitigation}{by}-level{self.level}{greedy}-episodes{self.episodes}-seed{self.seed}"
        )

    @property
    def is_reference(self) -> bool:
        """Whether the other cells of its policy are compared with this one."""
        return (self.backend.name, self.shots, self.mitigation, self.level) == REFERENCE

    def settings(self) -> dict[str, Any]:
        """All that the rewards depend on, as plain values; what comes from files by SHA-256."""
        values = {
            "policy": policy_sha256(self.policy),
            "device": _sha256(self.backend.contents),
            "shots": "exact" if self.shots is None else self.shots,
            "mitigation": self.mitigation,
            "level": self.level,
            "episodes": self.episodes,
            "seed": self.seed,
        }
        if self.greedy:  # cells of version 0.1.0 do not say that they sample
            values["greedy"] = True
        if self.calibration is not None:
            values["calibration"] = _sha256(self.calibration.contents)
        return values


def grid(
    policies: Sequence[AnyPolicy],
    backends: Sequence[Backend],
    shots: Sequence[int | None],
    mitigations: Sequence[str],
    levels: Sequence[int] = (2,),
    *,
    calibrations: Sequence[CalibrationFile] = (),
    episodes: int = 100,
    seed: int = 0,
    greedy: bool = False,
) -> list[Cell]:
    """For each policy its reference (`ideal`, exact, level 2), then every combination, once.

    Those of `left_out` are not there; a network has its reference alone. A calibration mitigates on
    every backend whose device it was measured on.

    Raises:
        CalibrationError: two calibrations are of one device, or one is not needed.
        StudyError: no combination is left, or two backends, policies or cells share a name.
    """
    ideal = DeviceBackend(IDEAL)
    _check_names("backends", [(backend.name, backend.contents) for backend in (ideal, *backends)])
    _check_names("policies", [(policy.name, policy_sha256(policy)) for policy in policies])
    words = left_out(backends, shots, mitigations, levels)
    settings = [
        combination
        for combination in product(backends, shots, mitigations, levels)
        if combination not in words
    ]
    has_circuits = any(not isinstance(policy, Network) for policy in policies)
    if has_circuits and not settings:
        raise StudyError(
            "No cell is left to play.",
            *(f"Left out: {why}." for why in dict.fromkeys(words.values())),
            "Add a --backend, --shots, --mitigation or --level that goes with the others.",
        )
    files = by_device(calibrations)
    mitigated = {
        backend.device.name for backend, _, name, _ in settings if has_circuits and name != "none"
    }
    check_needed(calibrations, {backend.device.name for backend in backends}, mitigated)
    cells = [
        Cell(policy, backend, count, mitigation, level, episodes, seed, calibration, greedy)
        for policy in policies
        for backend, count, mitigation, level in [
            (ideal, None, "none", 2),
            *([] if isinstance(policy, Network) else settings),
        ]
        for calibration in [files.get(backend.device.name) if mitigation != "none" else None]
    ]
    _check_names("cells", [(cell.name, json.dumps(cell.settings())) for cell in cells])
    return list({cell.name: cell for cell in cells}.values())


def left_out(
    backends: Sequence[Backend],
    shots: Sequence[int | None],
    mitigations: Sequence[str],
    levels: Sequence[int],
) -> dict[Combination, str]:
    """The combinations that a grid leaves out, each with the reason in words."""
    reasons = {
        combination: _why_not(*combination)
        for combination in product(backends, shots, mitigations, levels)
    }
    return {combination: why for combination, why in reasons.items() if why is not None}


def _why_not(backend: Backend, shots: int | None, mitigation: str, level: int) -> str | None:
    if mitigation != "none" and backend.name == IDEAL_NAME:
        return f"mitigation {mitigation} on ideal: it has no errors to mitigate"
    if mitigation == "response" and level != 2:
        return f"mitigation response at level {level}: response curves are those of level 2"
    return backend.cannot_play(shots, level)


def rename_duplicates(words: Sequence[str], policies: Sequence[AnyPolicy]) -> list[AnyPolicy]:
    """The policies, once each; where different ones share a name they are called by `words`.

    `words` are what the policies were asked for with, one for each; where these are the same too,
    the second is "NAME (2)".
    """
    contents: dict[str, set[str]] = {}
    for policy in policies:
        contents.setdefault(policy.name, set()).add(policy_sha256(policy))
    named: dict[str, list[str]] = {}
    different = []
    for word, policy in zip(words, policies, strict=True):
        name = policy.name if len(contents[policy.name]) == 1 else word
        hashes, own = named.setdefault(name, []), policy_sha256(policy)
        if own not in hashes:
            hashes.append(own)
            number = f" ({len(hashes)})" * (len(hashes) > 1)
            different.append(replace(policy, name=f"{name}{number}"))
    return different


def policy_sha256(policy: AnyPolicy) -> str:
    """The hash of all that a policy file holds but its metadata."""
    values = policy_values(policy)
    del values["metadata"]
    return _sha256(json.dumps(values))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _check_names(what: str, named: list[tuple[str, str]]) -> None:
    known: dict[str, str] = {}
    for name, contents in named:
        if known.setdefault(name, contents) != contents:
            raise StudyError(
                f"Two of the {what} are called {name!r}.",
                "Results tell them apart by name: rename one, or evaluate them apart.",
            )
