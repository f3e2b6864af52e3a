"""Backends: names, comparison, and pickling to other processes."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from qcompile.calibration import Calibration
from qcompile.device import IDEAL, load_device
from qcompile.errors import CalibrationError, QcompileError
from qcompile.execution import (
    Backend,
    DeviceBackend,
    OfflineExecutor,
    TwinExecutor,
    load_backend,
    open_executor,
)
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.passes import compile

PROGRAM = Program.of(map(Circuit.parse, ["h ry(x0)", "ry(x1) rz(x0) ry(0.3)"]), inputs=2)
X = np.random.default_rng(0).uniform(-3, 3, (4, 2))
NOTHING = np.zeros(0)


def measured(shots: int | None = None, part: str = "response") -> Calibration:
    device = load_device("fake_lima")
    return calibrate(OfflineExecutor(device, 1), np.arange(5), shots, parts=[part])  # type: ignore[list-item]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder with a calibration in lima.json."""
    monkeypatch.chdir(tmp_path)
    measured().save(Path("lima.json"))
    return tmp_path


NAMES = ("ideal", "ibm_lima", "lima.json", "qiskit:FakeLimaV2")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", NAMES)
def test_a_backend_travels(name: str) -> None:
    """The copy of another process plays the same counts, after the device was asked for or not."""
    backend = load_backend(name)
    early = pickle.loads(pickle.dumps(backend))
    device = backend.device
    late = pickle.loads(pickle.dumps(backend))
    assert early.contents == late.contents == backend.contents
    counts = []
    for own in (backend, early, late):
        executor = own.open(3)
        assert (own.name, own.device, executor.device) == (name, device, device)
        counts.append(executor.run(compile(PROGRAM, own.device), X, NOTHING, 50))
    np.testing.assert_array_equal(counts[0], counts[1])
    np.testing.assert_array_equal(counts[0], counts[2])


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("./lima.json", "lima.json"),
        ("ibmq_lima", "ibm_lima"),
        ("qiskit:fake_lima", "qiskit:FakeLimaV2"),
    ],
)
def test_one_backend_has_one_name(words: str, name: str) -> None:
    assert load_backend(words).name == name
    assert load_backend(words).contents == load_backend(name).contents


@pytest.mark.usefixtures("folder")
def test_contents_differ_when_results_do() -> None:
    measured(64).save(Path("other.json"))
    names = ("fake_lima", "lima.json", "other.json", "qiskit:FakeLimaV2")
    backends = [load_backend(name) for name in names]
    assert {backend.device.name for backend in backends} == {"fake_lima"}
    assert len({backend.contents for backend in backends}) == len(names)
    assert DeviceBackend(load_device("fake_lima")).contents == backends[0].contents


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shots", [None, 8])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_an_executor_refuses_the_same_as_its_backend(
    name: str, shots: int | None, level: int
) -> None:
    backend = load_backend(name)
    executor, executable = backend.open(0), compile(PROGRAM, backend.device, level)
    refused = False
    try:
        if shots is None:
            executor.expectation(executable, X, NOTHING)
        else:
            executor.run(executable, X, NOTHING, shots)
    except QcompileError:
        refused = True
    words = backend.cannot_play(shots, level)
    assert (words is not None) == refused
    assert words is None or f"on {name}: " in words


@pytest.mark.usefixtures("folder")
def test_executors_are_opened_from_names_devices_and_backends() -> None:
    ways: list[str | Backend] = ["lima.json", load_backend("lima.json")]
    assert all(isinstance(open_executor(way), TwinExecutor) for way in ways)
    assert isinstance(open_executor(IDEAL), OfflineExecutor)


@pytest.mark.usefixtures("folder")
def test_a_calibration_without_curves_is_refused_before_it_is_opened() -> None:
    measured(part="readout").save(Path("readout.json"))
    with pytest.raises(CalibrationError, match="has no response curves"):
        load_backend("readout.json")
