"""Everything except faults: the unmodified client's view of the service, jobs and batches."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import urllib.request
from datetime import datetime, timedelta
from email.utils import parsedate_to_datetime
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit_ibm_runtime import Batch, QiskitRuntimeService, Session
from qiskit_ibm_runtime.api.exceptions import RequestsApiError
from qiskit_ibm_runtime.exceptions import (
    IBMRuntimeError,
    RuntimeInvalidStateError,
    RuntimeJobMaxTimeoutError,
    RuntimeJobNotFound,
    RuntimeJobTimeoutError,
)
from qiskit_ibm_runtime.executor_sampler import Sampler
from qiskit_ibm_runtime.fake_provider import FakeLimaV2
from standin import CRN, Ledger, StandIn


def test_the_service_has_the_backends_and_their_calibration(service: Any) -> None:
    assert [b.name for b in service.backends()] == ["fake_lima", "fake_toronto"]
    backend, fake = service.backend("fake_lima"), FakeLimaV2()
    assert backend.num_qubits == 5
    assert backend.status().operational
    assert backend.status().status_msg == "active"
    assert backend.properties().t1(3) == fake.properties().t1(3)
    for gate in ("sx", "x", "measure"):
        assert backend.target[gate][(2,)].error == fake.target[gate][(2,)].error
    assert [instance["crn"] for instance in service.instances()] == [CRN]
    assert service.usage()["usage_remaining_seconds"] == 600


def test_a_wide_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    with StandIn() as stand_in:
        for name, value in stand_in.environment().items():
            monkeypatch.setenv(name, value)
        backend = QiskitRuntimeService().backend("fake_sherbrooke")
        circuit = QuantumCircuit(127, 127)
        circuit.x(range(0, 127, 2))
        circuit.measure(range(127), range(127))
        c = Sampler(backend).run([circuit], shots=1000).result()[0].data.c
    ones = c.to_bool_array(order="little").mean(axis=0)
    # One qubit of this machine reads nothing.
    assert ((ones > 0.5) == (np.arange(127) % 2 == 0)).sum() >= 126


def test_a_job_from_submission_to_usage(
    stand_in: StandIn, service: Any, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    sampler = make_sampler(backend, environment={"job_tags": ["step-1", "run"]})
    job = sampler.run([flip, flip], shots=500)
    assert job.usage_estimation == {"quantum_seconds": 2.35}
    result = job.result()
    assert [r.data.c.num_shots for r in result] == [500, 500]
    assert job.usage() == 2.35
    assert job.metrics()["usage"] == {"qpu_charge_time_seconds": 2.35, "status": "complete"}
    assert job.logs()
    assert service.usage()["usage_consumed_seconds"] == 2.35
    [entry] = stand_in.ledger().jobs
    assert entry.program_id == make_sampler.program
    assert (entry.id, sorted(entry.tags)) == (job.job_id(), ["run", "step-1"])
    assert (entry.circuits, entry.shots, entry.executions) == (2, 500, 1000)
    assert (entry.status, entry.charged_seconds, entry.results_fetched) == ("Completed", 2.35, 1)
    assert stand_in.ledger().requests["POST /jobs"] == 1


def test_another_service_finds_and_reads_a_job(
    stand_in: StandIn, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    job = make_sampler(backend, environment={"job_tags": ["mine"]}).run([flip], shots=50)
    make_sampler(backend).run([flip], shots=50)
    [found] = QiskitRuntimeService().jobs(job_tags=["mine"])
    assert found.job_id() == job.job_id()
    assert found.primitive_id == make_sampler.program
    assert found.tags == ["mine"]
    assert found.result()[0].data.c == job.result()[0].data.c
    assert found.inputs


def test_jobs_are_listed_by_page_time_and_state(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit
) -> None:
    sampler = Sampler(backend)
    ids = [sampler.run([flip], shots=10).job_id() for _ in range(23)]
    newest_first = ids[::-1]
    assert [j.job_id() for j in service.jobs(limit=None)] == newest_first
    assert [j.job_id() for j in service.jobs(limit=5, skip=3)] == newest_first[3:8]
    assert [j.job_id() for j in service.jobs(limit=2, descending=False)] == ids[:2]
    stand_in.settings.queue_seconds = 60
    waiting = sampler.run([flip], shots=10)
    assert [j.job_id() for j in service.jobs(pending=True)] == [waiting.job_id()]
    assert service.jobs(backend_name="fake_toronto") == []
    later, earlier = (datetime.now() + timedelta(minutes=by) for by in (1, -1))
    assert service.jobs(created_after=later) == []
    assert len(service.jobs(created_after=earlier, limit=None)) == 24
    assert service.backend("fake_lima").status().pending_jobs == 1


def test_tags_are_changed_and_jobs_deleted(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit
) -> None:
    job = Sampler(backend).run([flip], shots=10)
    assert job.update_tags(["new"]) == ["new"]
    job.wait_for_final_state()
    service.delete_job(job.job_id())
    with pytest.raises(RuntimeJobNotFound):
        service.job(job.job_id())
    assert service.jobs() == []
    assert [entry.deleted for entry in stand_in.ledger().jobs] == [True]


def test_jobs_of_a_batch(
    stand_in: StandIn, service: Any, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    with Batch(backend, max_time=600) as batch:
        sampler = make_sampler(batch)
        jobs = [sampler.run([flip], shots=1000) for _ in range(2)]
        assert [job.result()[0].data.c.num_shots for job in jobs] == [1000, 1000]
        assert batch.usage() == 4.7
        assert batch.details()["max_time"] == 600
    assert batch.status() == "Closed"
    assert {entry.session_id for entry in stand_in.ledger().jobs} == {batch.session_id}
    assert len(service.jobs(session_id=batch.session_id)) == 2
    reopened = make_sampler(Batch.from_id(batch.session_id, service))
    with pytest.raises(IBMRuntimeError, match="closed"):
        reopened.run([flip])
    assert len(stand_in.ledger().jobs) == 2


def test_a_cancelled_batch_cancels_what_waits(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.queue_seconds = 60
    batch = Batch(backend)
    job = Sampler(batch).run([flip], shots=10)
    batch.cancel()
    assert job.status() == "CANCELLED"
    assert stand_in.ledger().charged_seconds == 0


def test_the_plan_has_no_sessions(backend: Any) -> None:
    with pytest.raises(RequestsApiError, match="1352") as caught:
        Session(backend)
    assert caught.value.status_code == 403


def test_a_job_waits_runs_and_is_cancelled(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.queue_seconds = 0.2
    stand_in.settings.run_seconds = 5.0
    job = Sampler(backend).run([flip], shots=1000)
    assert job.status() == "QUEUED"
    with pytest.raises(RuntimeJobTimeoutError):
        job.result(timeout=0.1, poll_interval=0.1)
    time.sleep(0.2)
    assert job.status() == "RUNNING"
    job.cancel()
    assert 0 < stand_in.ledger().charged_seconds < 2.35
    with pytest.raises(RuntimeInvalidStateError, match="cancelled"):
        job.result()
    with pytest.raises(RuntimeInvalidStateError, match="cannot be cancelled"):
        job.cancel()


def test_a_job_cancelled_in_the_queue_is_free(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.queue_seconds = 60
    job = Sampler(backend).run([flip], shots=1000)
    job.cancel()
    assert job.usage() == 0
    assert [e.status for e in stand_in.ledger().jobs] == ["Cancelled"]


def test_a_job_ends_at_its_maximum_execution_time(
    stand_in: StandIn, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    job = make_sampler(backend, max_execution_time=3).run([flip], shots=10_000)
    with pytest.raises(RuntimeJobMaxTimeoutError, match="1305"):
        job.result()
    assert job.usage() == 3
    assert [e.status for e in stand_in.ledger().jobs] == ["Cancelled"]


def test_usage_comes_later_and_at_another_rate(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.usage_lag_seconds = 60
    stand_in.settings.usage_factor = 2
    job = Sampler(backend).run([flip], shots=1000)
    job.result()
    assert job.usage() == 0
    assert job.metrics()["usage"]["status"] == "pending"
    stand_in.settings.usage_lag_seconds = 0
    assert job.usage() == 4.7


def test_a_job_stays_in_the_queue_once_the_plan_is_used_up(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.usage_limit_seconds = 2
    sampler = Sampler(backend)
    sampler.run([flip], shots=10).result()
    with pytest.warns(UserWarning, match="usage limit"):
        job = sampler.run([flip], shots=10)
    time.sleep(0.05)
    assert job.status() == "QUEUED"


def test_too_many_executions_are_refused(
    stand_in: StandIn, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    with pytest.raises(IBMRuntimeError, match="10000000"):
        make_sampler(backend).run([flip] * 11, shots=1_000_000)
    assert stand_in.ledger().jobs == []


def test_gates_that_the_machine_lacks_are_refused(stand_in: StandIn, backend: Any) -> None:
    circuit = QuantumCircuit(1, 1)
    circuit.h(0)
    circuit.measure(0, 0)
    with pytest.raises(IBMRuntimeError, match="h is not supported"):
        Sampler(backend).run([circuit])  # this sampler leaves the check to the service
    assert stand_in.ledger().jobs == []


def test_reset_and_continued_circuits_are_refused(backend: Any) -> None:
    entangled, continued = QuantumCircuit(2, 1), QuantumCircuit(1, 1)
    entangled.cx(0, 1)
    entangled.reset(0)
    continued.measure(0, 0)
    continued.x(0)
    for circuit, why in ((entangled, "does not play reset"), (continued, "after its measurement")):
        with pytest.raises(IBMRuntimeError, match=why):
            Sampler(backend).run([circuit])


def test_a_process_of_its_own(flip: QuantumCircuit, monkeypatch: pytest.MonkeyPatch) -> None:
    command = [sys.executable, "-m", "standin", "--backend", "fake_lima=FakeLimaV2"]
    path = [entry for entry in sys.path if entry]
    monkeypatch.setenv("PYTHONPATH", ":".join(path))
    process = subprocess.Popen(
        [*command, "--usage-factor", "3"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        for _ in range(6):
            name, _, value = process.stdout.readline().removeprefix("export ").partition("=")
            monkeypatch.setenv(name, value.strip())
            if name == "IAM_URL":
                url = value.strip()
        job = Sampler(QiskitRuntimeService().backend("fake_lima")).run([flip], shots=1000)
        assert np.mean(job.result()[0].data.c.array) > 0.8
        _post(f"{url}/standin/faults", {"once": [{"kind": "job_fails"}]})
        with urllib.request.urlopen(f"{url}/standin/ledger") as answer:
            ledger = Ledger.model_validate_json(answer.read())
        assert [entry.id for entry in ledger.jobs] == [job.job_id()]
        assert ledger.charged_seconds == 7.05
        process.terminate()


def _post(url: str, body: dict[str, Any]) -> None:
    with urllib.request.urlopen(urllib.request.Request(url, json.dumps(body).encode())) as answer:
        assert answer.status == 200


@pytest.mark.parametrize("as_date", [False, True])
def test_more_jobs_in_a_minute_are_told_when_to_come_back(
    as_date: bool, stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.settings.jobs_per_minute, stand_in.settings.minute_seconds = 2, 30.0
    stand_in.faults.retry_after_is_a_date = as_date
    sampler = Sampler(backend)
    for _ in range(2):
        sampler.run([flip])
    with pytest.raises(IBMRuntimeError) as refused:
        sampler.run([flip])
    told = refused.value.__context__.__context__.response.headers["Retry-After"]
    seconds = parsedate_to_datetime(told).timestamp() - time.time() if as_date else int(told)
    assert 28 < seconds <= 31
    assert len(stand_in.ledger().jobs) == 2
    stand_in.settings.minute_seconds = 0.01
    time.sleep(0.01)
    sampler.run([flip])
