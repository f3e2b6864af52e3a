"""The hold of decisions in files: present only in format 2, if it exceeds one step."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.errors import PolicyError
from qcompile.policy import Dense, Network, load_policy, save_policy
from qcompile.policy.files import policy_values
from qcompile.sweep.evaluation.grid import policy_sha256

Make = Callable[..., Any]

SUFFIXES = (".json", ".pt")


def network(**changes: Any) -> Network:
    layers = [Dense(np.ones((2, 4)), np.zeros(2), "none")]
    return Network("net", "CartPole-v1", layers, **changes)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", ["circuits", "network"])
def test_it_reads_back(tmp_path: Path, suffix: str, kind: str, awkward: Make) -> None:
    plain = awkward() if kind == "circuits" else network()
    files = {hold: tmp_path / f"{hold}{suffix}" for hold in (1, 4)}
    for hold, path in files.items():
        save_policy(replace(plain, hold=hold), path)
        assert load_policy(path).hold == hold
    assert policy_sha256(load_policy(files[1])) == policy_sha256(plain)
    assert policy_sha256(load_policy(files[4])) != policy_sha256(plain)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_policy_that_holds_nothing_keeps_its_bytes(
    tmp_path: Path, suffix: str, values: Make, write_json: Make
) -> None:
    """One of format 1, and the same with "hold": 1 in format 2, are one policy and one file."""
    first = load_policy(write_json(tmp_path / "a.json", values()))
    more = {"format": "qcompile-policy-2", "hold": 1}
    second = load_policy(write_json(tmp_path / "b.json", values() | more))
    written = []
    for name, policy in (("c", first), ("d", second)):
        save_policy(policy, tmp_path / f"{name}{suffix}")
        written.append((tmp_path / f"{name}{suffix}").read_bytes().replace(b"d/", b"c/"))
    assert written[0] == written[1]
    assert "hold" not in policy_values(first)
    assert policy_values(first)["format"] == "qcompile-policy-1"
    assert "hold" not in policy_values(network())


def test_a_held_policy_is_of_format_2(awkward: Make) -> None:
    plain = policy_values(awkward())
    expected = plain | {"format": "qcompile-policy-2", "hold": 3}
    assert policy_values(replace(awkward(), hold=3)) == expected


def test_format_1_has_no_hold(tmp_path: Path, values: Make, write_json: Make) -> None:
    path = write_json(tmp_path / "p.json", values() | {"hold": 2})
    with pytest.raises(PolicyError) as caught:
        load_policy(path)
    assert str(caught.value).splitlines() == [
        f"{path} is not a policy file.",
        "  hold: unknown key (found 2)",
        '  It is valid in the other format: "format": "qcompile-policy-2".',
    ]


@pytest.mark.parametrize("hold", [0, -1, 2.0, "2", None, True, 1_000_001])
@pytest.mark.parametrize("kind", ["circuits", "network"])
def test_what_is_not_a_number_of_steps_is_refused(
    tmp_path: Path, kind: str, hold: Any, values: Make, write_json: Make
) -> None:
    document = values() | {"format": "qcompile-policy-2"} if kind == "circuits" else None
    document = document or policy_values(network())
    path = write_json(tmp_path / "p.json", document | {"hold": hold})
    with pytest.raises(PolicyError, match=r"is not a policy file\.\n  hold: "):
        load_policy(path)
    if not isinstance(hold, str):
        with pytest.raises(PolicyError, match="It must be a whole number"):
            network(hold=hold)


def test_it_is_told(awkward: Make) -> None:
    for policy in (awkward(), network()):
        held = replace(policy, hold=4)
        assert repr(held) == repr(policy)[:-1] + ", hold 4)"
        added = "<tr><td>decision</td><td>held for 4 environment steps</td></tr>"
        assert held._repr_html_().replace(added, "") == policy._repr_html_()
        assert added in held._repr_html_()


def test_numbers_of_a_held_file_are_json(tmp_path: Path, awkward: Make) -> None:
    save_policy(replace(awkward(), hold=4), tmp_path / "p.json")
    assert json.loads((tmp_path / "p.json").read_text())["hold"] == 4
