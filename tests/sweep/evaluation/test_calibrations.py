"""Twins and given calibrations in a grid: what mitigates where, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import Calibration
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.device import IDEAL, load_device
from qcompile.errors import CalibrationError, StudyError
from qcompile.execution import DeviceBackend, OfflineExecutor, load_backend
from qcompile.execution.backend import TwinBackend
from qcompile.mitigation import calibrate
from qcompile.policy import Policy
from qcompile.sweep.evaluation.calibrations import CalibrationFile
from qcompile.sweep.evaluation.cell import (
    CellResult,
    check_calibrations,
    folder_of,
    run_cell,
)
from qcompile.sweep.evaluation.grid import Cell, grid, left_out

MakeCell = Callable[..., Cell]

BOTH = ("readout", "response")
LIMA = load_backend("ibm_lima")


def measured(
    name: str = "ibm_lima", *, parts: Any = BOTH, qubits: int = 5, shots: int | None = None
) -> Calibration:
    executor = OfflineExecutor(load_device(name), 1)
    return calibrate(executor, np.arange(qubits), shots, parts=parts)


def rewards(cell: Cell) -> list[float]:
    result = run_cell(cell)
    assert isinstance(result, CellResult)
    return list(result.rewards.values())


def mitigations(cells: list[Cell]) -> list[tuple[str, str, str | None]]:
    return [
        (c.backend.name, c.mitigation, c.calibration and c.calibration.name)  # type: ignore[misc]
        for c in cells
        if not c.is_reference
    ]


# What is played.


def test_a_twin_of_an_exact_calibration_plays_like_the_noise_model(cell: MakeCell) -> None:
    """Its <Z> differ by rounding alone, and actions are drawn alike."""
    twin = TwinBackend("lima.json", measured())
    assert rewards(cell(backend=twin, shots=None)) == rewards(cell(shots=None))
    noisy, ideal = LIMA, DeviceBackend(IDEAL)
    played = [rewards(cell(backend=b, shots=None, episodes=20)) for b in (noisy, ideal)]
    assert played[0] != played[1]


@pytest.mark.parametrize("backend", [LIMA, TwinBackend("lima.json", measured())])
def test_an_exact_calibration_brings_the_ideal_back(cell: MakeCell, backend: Any) -> None:
    file = CalibrationFile("own.json", measured())
    mitigated = cell(backend=backend, shots=None, mitigation="response", calibration=file)
    assert rewards(mitigated) == rewards(cell(backend=DeviceBackend(IDEAL), shots=None))


def test_a_calibrated_cell_is_a_run(cell: MakeCell) -> None:
    file = CalibrationFile("cal/lima.json", measured(shots=64))
    mitigated = cell(mitigation="readout", calibration=file)
    result = run_cell(mitigated)
    assert isinstance(result, CellResult)
    options: Any = {"shots": 16, "mitigation": "readout", "seed": 5}
    deployment = Deployment(
        mitigated.policy,
        "ibm_lima",
        calibration=file.calibration,
        calibration_file="cal/lima.json",
        **options,
    )
    run = play(deployment, 3).summary()
    assert result.summary | {"wall_seconds": 0} == run | {"wall_seconds": 0}
    assert result.summary["executions"] == 16 * result.summary["env_steps"]


def test_a_sampled_cell_names_the_versions_it_depends_on(cell: MakeCell) -> None:
    result = run_cell(cell(backend=load_backend("qiskit:FakeLimaV2")))
    assert isinstance(result, CellResult)
    assert (result.summary["backend"], result.summary["kind"]) == ("fake_lima", "noise-model")
    assert {"qiskit", "qiskit-aer", "qiskit-ibm-runtime"} < {*result.versions}


def test_a_result_is_that_of_its_calibration_alone(cell: MakeCell, tmp_path: Path) -> None:
    first, second = (CalibrationFile("a.json", measured(shots=n)) for n in (64, 65))
    mitigated = cell(mitigation="readout", calibration=first)
    result = run_cell(mitigated)
    assert isinstance(result, CellResult)
    folder = folder_of(tmp_path)
    folder.write(mitigated, result)
    assert folder.read(mitigated) is not None
    renamed = CalibrationFile("b.json", first.calibration)
    assert folder.read(cell(mitigation="readout", calibration=renamed)) is not None
    other = cell(mitigation="readout", calibration=second)
    folder.file(other).write_text(json.dumps(result.model_dump() | {"name": other.name}))
    assert other.name not in (mitigated.name, cell(mitigation="readout").name)
    assert folder.read(other) is None
    assert folder.read(cell(mitigation="readout")) is None


# What a grid makes of them.


def test_a_twin_beside_its_device(policy: Policy) -> None:
    calibration = measured()
    twins = [TwinBackend(name, calibration) for name in ("lima.json", "old/lima.json")]
    sampler = load_backend("qiskit:FakeLimaV2")
    cells = grid([policy], [LIMA, *twins, sampler], [16], ["none", "readout"])
    assert len({cell.name for cell in cells}) == len(cells) == 9
    assert all("/" not in cell.name and ":" not in cell.name for cell in cells)
    assert cells[3].name == "tiny-lima.json-16-none-level2-episodes100-seed0"


def test_a_calibration_mitigates_on_its_device_alone(policy: Policy) -> None:
    file = CalibrationFile("lima.json", measured())
    twin = TwinBackend("twin.json", measured())
    backends = [LIMA, twin, load_backend("ibm_belem")]
    cells = grid([policy], backends, [16], ["none", "readout"], calibrations=[file])
    assert mitigations(cells) == [
        ("ibm_lima", "none", None),
        ("ibm_lima", "readout", "lima.json"),
        ("twin.json", "none", None),
        ("twin.json", "readout", "lima.json"),
        ("ibm_belem", "none", None),
        ("ibm_belem", "readout", None),
    ]


def test_what_cannot_be_played_is_left_out(policy: Policy) -> None:
    twin, sampler = TwinBackend("lima.json", measured()), load_backend("qiskit:FakeLimaV2")
    sides: Any = ([twin, sampler], [8, None], ["none", "response"], [1, 2])
    cells = grid([policy], *sides)
    assert [(c.backend.name, c.shots, c.mitigation, c.level) for c in cells[1:]] == [
        ("lima.json", 8, "none", 2),
        ("lima.json", 8, "response", 2),
        ("lima.json", None, "none", 2),
        ("lima.json", None, "response", 2),
        ("qiskit:FakeLimaV2", 8, "none", 1),
        ("qiskit:FakeLimaV2", 8, "none", 2),
        ("qiskit:FakeLimaV2", 8, "response", 2),
    ]
    assert {*left_out(*sides).values()} == {
        "level 1 on lima.json: a twin only supports level 2",
        "mitigation response at level 1: response curves are measured at level 2",
        "shots exact on qiskit:FakeLimaV2: it runs through a sampler, which needs shots",
    }
    with pytest.raises(
        StudyError, match=r"(?s)^There is no combination to play.*Left out: level 1 on"
    ):
        grid([policy], [twin], [8], ["none"], [1])


# What is refused.


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["ibm_lima", "ibm_lima"], r"0\.json and 1\.json are both of ibm_lima\."),
        (["ibm_belem"], r"(?s)0\.json is of ibm_belem, which is not in.*grid: ibm_lima"),
    ],
)
def test_calibrations_that_do_not_belong(policy: Policy, names: list[str], words: str) -> None:
    files = [CalibrationFile(f"{i}.json", measured(name)) for i, name in enumerate(names)]
    with pytest.raises(CalibrationError, match=words):
        grid([policy], [LIMA], [8], ["readout"], calibrations=files)


def test_a_calibration_that_nothing_reads(policy: Policy) -> None:
    file = CalibrationFile("lima.json", measured())
    with pytest.raises(CalibrationError, match=r"^lima\.json is not needed: nothing on ibm_lima"):
        grid([policy], [LIMA], [8], ["none"], calibrations=[file])


@pytest.mark.parametrize(
    ("changes", "missing"),
    [
        ({"parts": ["response"]}, "The calibration has no assignment matrices."),
        ({"qubits": 2}, "Qubit 2 has no calibration."),
    ],
)
def test_a_given_calibration_that_lacks_something(
    cell: MakeCell, changes: dict[str, Any], missing: str
) -> None:
    file = CalibrationFile("a.json", measured(**changes))
    mitigated = cell(mitigation="readout", calibration=file)
    with pytest.raises(CalibrationError) as refused:
        check_calibrations([cell(), mitigated])
    first, second, *_ = str(refused.value).splitlines()
    assert first == "a.json cannot mitigate tiny on ibm_lima (readout):"
    assert second == f"  {missing}"


def test_a_twin_that_lacks_something(cell: MakeCell) -> None:
    twin = TwinBackend("twin.json", measured(parts=["response"]))
    check_calibrations([cell(backend=twin), cell(backend=twin, mitigation="response")])
    with pytest.raises(
        CalibrationError, match=r"^twin\.json cannot mitigate tiny on twin\.json \(readout\):"
    ):
        check_calibrations([cell(backend=twin, mitigation="readout")])


def test_nothing_is_measured_for_the_check(cell: MakeCell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qcompile.deploy.measurement.calibrate", pytest.fail)
    check_calibrations([cell(mitigation="readout"), cell()])


def test_cells_of_one_name_are_refused(policy: Policy) -> None:
    """a on b-c, and a-b on c."""
    policies = [replace(policy, name=name) for name in ("a", "a-b")]
    backends = [TwinBackend(name, measured()) for name in ("b-c.json", "c.json")]
    with pytest.raises(StudyError, match=r"^Two cells have the name 'a-b-c\.json-8-none"):
        grid(policies, backends, [8], ["none"])
