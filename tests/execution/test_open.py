"""Opening backends from names, files, records, executors and Qiskit objects."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit.primitives import StatevectorSampler
from qiskit.providers.fake_provider import GenericBackendV2
from qiskit_aer import AerSimulator

from qcompile.device import load_device
from qcompile.errors import DeviceError
from qcompile.execution import (
    DeviceBackend,
    OfflineExecutor,
    PrimitiveExecutor,
    load_backend,
    open_executor,
)
from qcompile.execution.backend import TwinBackend
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.passes import compile
from qcompile.snapshot import find_backend

LIMA = find_backend("FakeLimaV2")
PROGRAM = Program.of(map(Circuit.parse, ["x", "ry(x0)"]), inputs=1)
X, NOTHING = np.array([[0.4], [2.0]]), np.zeros(0)


def named(name: str) -> Any:
    backend = GenericBackendV2(2, seed=1)
    backend.name = name
    return backend


def test_records_and_files(tmp_path: Path) -> None:
    device = load_device("fake_lima")
    path = tmp_path / "mine.json"
    path.write_text(device.to_json())
    for way in (device, path, str(path)):
        backend = load_backend(way)
        assert isinstance(backend, DeviceBackend)
        assert backend.device == device
    calibration = calibrate(OfflineExecutor(device, 1), np.arange(5), None, parts=["response"])
    twin = load_backend(calibration)
    assert isinstance(twin, TwinBackend)
    assert (twin.name, twin.open().kind) == ("twin of fake_lima", "measured-response")
    assert load_backend(twin) is twin
    executor = OfflineExecutor(device)
    assert load_backend(executor) is executor
    assert open_executor(executor) is executor


def test_a_qiskit_backend_is_the_noise_model_of_its_calibration() -> None:
    backend = load_backend(LIMA)
    assert backend.name == "fake_lima"
    assert backend.device.qubits == load_device("fake_lima").qubits
    assert backend.open(0).kind == "noise-model"
    assert pickle.loads(pickle.dumps(backend)).contents == backend.contents


def test_a_copy_in_aer_has_the_calibration_of_its_target() -> None:
    """Aer copies the readout error of both states together."""
    original, copied = (
        load_backend(LIMA).device,
        load_backend(AerSimulator.from_backend(LIMA)).device,
    )
    assert copied.name == "aer_simulator_from_fake_lima"
    for one, other in zip(original.qubits, copied.qubits, strict=True):
        assert other.t1_us == pytest.approx(one.t1_us)
        assert other.t2_us == pytest.approx(one.t2_us)
        assert other.p10 == other.p01 == pytest.approx((one.p10 + one.p01) / 2)
        assert other.gates["sx"].error == pytest.approx(one.gates["sx"].error)
    executor = PrimitiveExecutor(AerSimulator.from_backend(LIMA), seed=1)
    shots = 4000
    ones = executor.run(compile(PROGRAM, executor.device), X, NOTHING, shots)
    executable = compile(PROGRAM, copied)
    wanted = (1 - OfflineExecutor(copied).expectation(executable, X, NOTHING)) / 2
    assert (np.abs(ones / shots - wanted) < 6 * np.sqrt(wanted * (1 - wanted) / shots)).all()


@pytest.mark.parametrize(
    ("name", "clean"),
    [("my backend (5q)", "my_backend_5q"), ("a" * 200, "a" * 100), ("??", "backend")],
)
def test_names_are_cleaned(name: str, clean: str) -> None:
    assert load_backend(named(name)).name == clean


def test_a_sampler_plays() -> None:
    """A perfect sampler on a noisy backend: x gives ones alone."""
    backend = load_backend(LIMA, sampler=StatevectorSampler(seed=3))
    assert backend.cannot_play(None, 2) == (
        "shots exact on fake_lima: it runs through a sampler, which needs shots"
    )
    assert backend.cannot_play(8, 0) is None
    executor = backend.open()
    assert (executor.kind, executor.device) == ("noise-model", backend.device)
    ones = executor.run(compile(PROGRAM, backend.device), X, NOTHING, 50)
    assert ones[:, 0].tolist() == [50, 50]
    assert backend.contents != load_backend(LIMA).contents


@pytest.mark.parametrize(
    ("way", "words"),
    [
        (3.0, "load_backend cannot take an object of type float"),
        (AerSimulator(), "has all its values"),
    ],
)
def test_other_objects_are_refused(way: Any, words: str) -> None:
    with pytest.raises(DeviceError, match=words):
        load_backend(way)


def test_a_sampler_needs_its_backend() -> None:
    with pytest.raises(DeviceError, match="sampler= needs the Qiskit backend"):
        load_backend("fake_lima", sampler=StatevectorSampler())
