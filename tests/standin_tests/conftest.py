"""A running stand-in, and the client of qiskit-ibm-runtime as a user has it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from qiskit import QuantumCircuit
from qiskit_ibm_runtime import QiskitRuntimeService, SamplerV2
from qiskit_ibm_runtime.executor_sampler import Sampler
from standin import StandIn

Make = Callable[..., Any]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[StandIn]:
    machines = {"fake_lima": "FakeLimaV2", "fake_toronto": "FakeTorontoV2"}
    # A job that still runs at the first poll costs the client half a second of sleep.
    with StandIn(machines, seed=7, run_seconds=0.0) as running:
        for name, value in running.environment().items():
            monkeypatch.setenv(name, value)
        # The client reads the source of every frame on the stack for each request otherwise.
        monkeypatch.setenv("USAGE_DATA_OPT_OUT", "True")
        yield running


@pytest.fixture
def service(stand_in: StandIn) -> QiskitRuntimeService:
    return QiskitRuntimeService()


@pytest.fixture
def backend(service: QiskitRuntimeService) -> Any:
    return service.backend("fake_lima")


@pytest.fixture(params=["sampler", "executor"])
def make_sampler(request: pytest.FixtureRequest) -> Make:
    """Make a sampler of one of the two programs."""

    def make(mode: Any, **options: Any) -> Any:
        with warnings.catch_warnings():  # SamplerV2 is deprecated since 0.50
            warnings.simplefilter("ignore", DeprecationWarning)
            return (SamplerV2 if request.param == "sampler" else Sampler)(mode, options=options)

    make.program = request.param  # type: ignore[attr-defined]
    return make


@pytest.fixture
def flip() -> QuantumCircuit:
    """x, then a measurement of one qubit."""
    circuit = QuantumCircuit(1, 1)
    circuit.x(0)
    circuit.measure(0, 0)
    return circuit
