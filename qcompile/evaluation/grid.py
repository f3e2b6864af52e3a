"""A grid is policies x devices x shots x mitigations x levels; a cell is one of each."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from qcompile.device import IDEAL, Device
from qcompile.errors import StudyError
from qcompile.policy import Policy
from qcompile.policy.files import policy_values

_SAFE = re.compile(r"[\w.-]{1,80}", re.ASCII)


@dataclass(frozen=True, eq=False)
class Cell:
    """A policy on a device, with all that its rewards depend on; `shots` None is exact.

    Episode i resets with `seed` + i, in every cell alike.
    """

    policy: Policy
    device: Device
    shots: int | None
    mitigation: str
    level: int
    episodes: int
    seed: int

    @property
    def name(self) -> str:
        """The name of its file: unlike that of any other cell of a grid."""
        shots = "exact" if self.shots is None else self.shots
        return (
            f"{file_name(self.policy.name)}-{self.device.name}-{shots}-{self.mitigation}"
            f"-level{self.level}-episodes{self.episodes}-seed{self.seed}"
        )

    @property
    def is_reference(self) -> bool:
        """Whether the other cells of its policy are compared with this one."""
        settings = (self.shots, self.mitigation, self.level)
        return self.device.is_ideal and settings == (None, "none", 2)

    def settings(self) -> dict[str, Any]:
        """All that the rewards depend on, as plain values; policy and device by SHA-256."""
        return {
            "policy": policy_sha256(self.policy),
            "device": _sha256(self.device.to_json()),
            "shots": "exact" if self.shots is None else self.shots,
            "mitigation": self.mitigation,
            "level": self.level,
            "episodes": self.episodes,
            "seed": self.seed,
        }


def grid(
    policies: Sequence[Policy],
    devices: Sequence[Device],
    shots: Sequence[int | None],
    mitigations: Sequence[str],
    levels: Sequence[int] = (2,),
    *,
    episodes: int = 100,
    seed: int = 0,
) -> list[Cell]:
    """For each policy its reference (`ideal`, exact, level 2), then every combination, once.

    `ideal` has nothing to mitigate: its combinations with a mitigation are left out.

    Raises:
        StudyError: no combination is left, or two devices or policies share a name.
    """
    _check_names("devices", [(device.name, device.to_json()) for device in devices])
    _check_names("policies", [(policy.name, policy_sha256(policy)) for policy in policies])
    settings = [
        combination
        for combination in product(devices, shots, mitigations, levels)
        if not needless(combination[0], combination[2])
    ]
    if not settings:
        raise StudyError(
            "No cell is left to play: ideal has no errors to mitigate.",
            "Say --mitigation none, or another --backend.",
        )
    cells = [
        Cell(policy, *combination, episodes, seed)
        for policy in policies
        for combination in [(IDEAL, None, "none", 2), *settings]
    ]
    return list({cell.name: cell for cell in cells}.values())


def needless(device: Device, mitigation: str) -> bool:
    """Whether the device has nothing that the mitigation could undo."""
    return device.is_ideal and mitigation != "none"


def told_apart(words: Sequence[str], policies: Sequence[Policy]) -> list[Policy]:
    """The policies, once each; where different ones share a name they are called by `words`.

    `words` are what the policies were asked for with, one for each.
    """
    contents: dict[str, set[str]] = {}
    for policy in policies:
        contents.setdefault(policy.name, set()).add(policy_sha256(policy))
    named: dict[tuple[str, str], Policy] = {}
    for word, policy in zip(words, policies, strict=True):
        own = policy if len(contents[policy.name]) == 1 else replace(policy, name=word)
        named.setdefault((own.name, policy_sha256(policy)), own)
    return list(named.values())


def file_name(name: str) -> str:
    """`name` where it can be part of a file's name; else what can, and a few digits of its hash."""
    if _SAFE.fullmatch(name):
        return name
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', name)[:60]}-{_sha256(name)[:8]}"


def policy_sha256(policy: Policy) -> str:
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
                "Results tell them apart by name: change `name` in one of the files.",
            )
