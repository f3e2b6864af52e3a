"""What a grid holds: every combination once, its references, and names that tell cells apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from qcompile.device import IDEAL
from qcompile.errors import StudyError
from qcompile.execution import Backend, DeviceBackend, load_backend
from qcompile.policy import Policy
from qcompile.sweep.evaluation.grid import Cell, file_name, grid, policy_sha256, rename_duplicates

MakeCell = Callable[..., Cell]

PERFECT = DeviceBackend(IDEAL)


@pytest.fixture
def lima() -> Backend:
    return load_backend("ibm_lima")


def settings(cells: list[Cell]) -> list[tuple[str, str, int | None, str, int]]:
    return [(c.policy.name, c.backend.name, c.shots, c.mitigation, c.level) for c in cells]


def test_every_combination_and_a_reference_for_each_policy(policy: Policy, lima: Backend) -> None:
    other = replace(policy, name="other")
    cells = grid([policy, other], [lima], [8, None], ["none", "readout"], [0, 2], episodes=3)
    assert len(cells) == 2 * (1 + 8)
    assert settings(cells)[:3] == [
        ("tiny", "ideal", None, "none", 2),
        ("tiny", "ibm_lima", 8, "none", 0),
        ("tiny", "ibm_lima", 8, "none", 2),
    ]
    assert [index for index, cell in enumerate(cells) if cell.is_reference] == [0, 9]
    assert len({cell.name for cell in cells}) == 18
    assert {(cell.episodes, cell.seed) for cell in cells} == {(3, 0)}


def test_the_reference_is_played_once(policy: Policy) -> None:
    cells = grid([policy], [PERFECT, DeviceBackend(IDEAL)], [None, 8], ["none"])
    assert settings(cells) == [
        ("tiny", "ideal", None, "none", 2),
        ("tiny", "ideal", 8, "none", 2),
    ]


def test_the_ideal_is_not_mitigated(policy: Policy, lima: Backend) -> None:
    cells = grid([policy], [PERFECT, lima], [8], ["none", "readout"])
    assert settings(cells)[1:] == [
        ("tiny", "ideal", 8, "none", 2),
        ("tiny", "ibm_lima", 8, "none", 2),
        ("tiny", "ibm_lima", 8, "readout", 2),
    ]
    with pytest.raises(StudyError, match=r"(?s)^There is no combination.*ideal: it has no errors"):
        grid([policy], [PERFECT], [8], ["readout"])


def test_two_backends_of_one_name_are_refused(policy: Policy, lima: Backend) -> None:
    other = DeviceBackend(lima.device.model_copy(update={"source": "elsewhere"}))
    with pytest.raises(StudyError, match=r"^Two backends have the name 'ibm_lima'\."):
        grid([policy], [lima, other], [8], ["none"])


def test_policies_of_one_name_are_called_as_they_were_asked_for(policy: Policy) -> None:
    other, alone = replace(policy, bias=policy.bias + 1), replace(policy, name="alone")
    named = rename_duplicates(
        ["a/tiny.pt", "b/tiny.pt", "x.pt", "a/tiny.pt", "x.pt"],
        [policy, other, alone, policy, alone],
    )
    assert [p.name for p in named] == ["a/tiny.pt", "b/tiny.pt", "alone"]
    assert named[1].bias.tolist() == other.bias.tolist()
    assert [p.name for p in rename_duplicates(["a", "b"], [policy, policy])] == ["tiny"]
    with pytest.raises(StudyError, match=r"^Two policies have the name 'tiny'\."):
        grid([policy, other], [PERFECT], [8], ["none"])


def test_any_policy_name_gives_a_file_name() -> None:
    names = ["tiny", "a b", "a-b", "../../x", "a/b", "x" * 300, "é", "x" * 299, ".hidden", ".."]
    files = [file_name(name) for name in names]
    assert (files[0], files[2]) == ("tiny", "a-b")
    assert len({*files}) == len(names)
    assert all(len(file) < 100 and "/" not in file and file[0] != "." for file in files)


def test_settings_change_with_all_that_matters(cell: MakeCell, policy: Policy) -> None:
    plain = cell()
    changed = [
        cell(policy=replace(policy, bias=policy.bias + 1e-9)),
        cell(backend=load_backend("ibm_belem")),
        cell(shots=None),
        cell(mitigation="readout"),
        cell(level=1),
        cell(episodes=4),
        cell(seed=6),
        cell(greedy=True),
    ]
    assert all(other.settings() != plain.settings() for other in changed)
    assert len({other.name for other in changed[1:]} | {plain.name}) == 8
    assert policy_sha256(replace(policy, metadata={"note": 1})) == policy_sha256(policy)
