"""A grid is policies x backends x shots x mitigations x levels; a cell is one of each."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from qcompile.caller import option
from qcompile.device import IDEAL, IDEAL_NAME
from qcompile.errors import StudyError
from qcompile.execution import Backend, DeviceBackend
from qcompile.output import file_name
from qcompile.policy import AnyPolicy, Network, Policy
from qcompile.policy.files import policy_values
from qcompile.sweep.evaluation.calibrations import CalibrationFile, by_device, check_needed

Combination = tuple[Backend, int | None, str, int]
"""Backend, shots, mitigation and level."""

REFERENCE = (IDEAL_NAME, None, "none", 2)
"""The combination that others of a policy are compared with: backend name, shots and so on."""


@dataclass(frozen=True, eq=False)
class Cell:
    """A policy on a backend, with everything that its rewards depend on; `shots` None is exact.

    Episode i resets with `seed` + i in every cell. `calibration` is used to mitigate; without it a
    twin uses its own, and any other backend is calibrated first. `greedy` takes the most probable
    action instead of sampling one.
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
        """The name of the cell's file, unique in a grid."""
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
        """Everything that the rewards depend on, as plain values; files by their SHA-256."""
        values = {
            "policy": policy_sha256(self.policy),
            "device": _sha256(self.backend.contents),
            "shots": "exact" if self.shots is None else self.shots,
            "mitigation": self.mitigation,
            "level": self.level,
            "episodes": self.episodes,
            "seed": self.seed,
        }
        if isinstance(self.policy, Policy) and self.policy.program.has_products:
            values["couplings"] = _sha256(self.backend.device.to_json())
        if self.greedy:  # cells of version 0.1.0 do not have this key
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
    """For each policy its reference (`ideal`, exact, level 2), then every other combination once.

    Combinations in `left_out` are omitted; a network has only its reference. A calibration
    mitigates on every backend of the device that it was measured on.

    Raises:
        CalibrationError: two calibrations are of the same device, or one is not needed.
        StudyError: there is no combination to play, or two backends, policies or cells share a
            name.
    """
    ideal = DeviceBackend(IDEAL)
    _check_names("backends", [(backend.name, backend.contents) for backend in (ideal, *backends)])
    _check_names("policies", [(policy.name, policy_sha256(policy)) for policy in policies])
    reasons = left_out(backends, shots, mitigations, levels)
    settings = [
        combination
        for combination in product(backends, shots, mitigations, levels)
        if combination not in reasons
    ]
    has_circuits = any(not isinstance(policy, Network) for policy in policies)
    if has_circuits and not settings:
        raise StudyError(
            "There is no combination to play.",
            *(f"Left out: {why}." for why in dict.fromkeys(reasons.values())),
            f"Add a {option('backend')}, {option('shots')}, {option('mitigation')} or "
            f"{option('level')} that fits the others.",
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
    """The combinations that a grid leaves out, each with the reason."""
    reasons = {
        combination: _why_not(*combination)
        for combination in product(backends, shots, mitigations, levels)
    }
    return {combination: why for combination, why in reasons.items() if why is not None}


def _why_not(backend: Backend, shots: int | None, mitigation: str, level: int) -> str | None:
    if mitigation != "none" and backend.name == IDEAL_NAME:
        return f"mitigation {mitigation} on ideal: it has no errors to mitigate"
    if mitigation == "response" and level != 2:
        return f"mitigation response at level {level}: response curves are measured at level 2"
    return backend.cannot_play(shots, level)


def rename_duplicates(words: Sequence[str], policies: Sequence[AnyPolicy]) -> list[AnyPolicy]:
    """The policies without duplicates; different ones with the same name are renamed.

    `words` is how the user named each policy. It replaces the name of policies that share one; if
    these words are the same too, the second is "NAME (2)".
    """
    contents: dict[str, set[str]] = {}
    for policy in policies:
        contents.setdefault(policy.name, set()).add(policy_sha256(policy))
    hashes_by_name: dict[str, list[str]] = {}
    different = []
    for word, policy in zip(words, policies, strict=True):
        name = policy.name if len(contents[policy.name]) == 1 else word
        hashes, sha256 = hashes_by_name.setdefault(name, []), policy_sha256(policy)
        if sha256 not in hashes:
            hashes.append(sha256)
            number = f" ({len(hashes)})" * (len(hashes) > 1)
            different.append(replace(policy, name=f"{name}{number}"))
    return different


def policy_sha256(policy: AnyPolicy) -> str:
    """The hash of a policy file without its metadata."""
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
                f"Two {what} have the name {name!r}.",
                "Results are stored by name: rename one, or evaluate them separately.",
            )
