"""Every kind of fault once: what the raw client sees, and what the ledger records."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.request
from typing import Any

import pytest
from qiskit import QuantumCircuit
from qiskit.primitives import PrimitiveResult
from qiskit.providers.exceptions import QiskitBackendNotFoundError
from qiskit_ibm_runtime import IBMBackend, QiskitRuntimeService, SamplerV2
from qiskit_ibm_runtime.api.exceptions import RequestsApiError
from qiskit_ibm_runtime.exceptions import (
    IBMNotAuthorizedError,
    IBMRuntimeError,
    RuntimeInvalidStateError,
    RuntimeJobFailureError,
    RuntimeJobTimeoutError,
)
from qiskit_ibm_runtime.executor_sampler import Sampler
from qiskit_ibm_runtime.ibm_backend import IBMRetiredBackend
from requests.adapters import HTTPAdapter
from standin import API_KEY, Fault, StandIn

SUBMIT, RESULTS = "POST /jobs", "GET /jobs/{id}/results"
STATUS = {
    Fault.RATE_LIMITED: 429,
    Fault.SERVER_ERROR: 500,
    Fault.BAD_GATEWAY: 502,
    Fault.UNAVAILABLE: 503,
    Fault.GATEWAY_TIMEOUT: 504,
}


@pytest.fixture
def no_retries(service: Any) -> None:
    """Let the client see every fault: it repeats nothing."""
    service._active_api_client._session.mount("http://", HTTPAdapter(max_retries=0))


@pytest.mark.usefixtures("no_retries")
@pytest.mark.parametrize("kind", STATUS)
def test_a_request_that_fails_before_it_is_handled(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit, kind: Fault
) -> None:
    stand_in.faults.once(kind, on=SUBMIT)
    with pytest.raises(IBMRuntimeError, match=f"{STATUS[kind]} ") as caught:
        Sampler(backend).run([flip])
    # The status is in the context alone, and of a 503 it is not even there.
    assert isinstance(caught.value.__context__, RequestsApiError)
    assert caught.value.__context__.status_code == (-1 if kind == "unavailable" else STATUS[kind])
    assert stand_in.ledger().jobs == []
    assert stand_in.ledger().faults == {str(kind): 1}
    Sampler(backend).run([flip])


def test_the_client_waits_as_a_429_asks_but_not_for_jobs(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.retry_after_seconds = 1
    stand_in.faults.once("rate_limited", on="GET /jobs")
    start = time.monotonic()
    assert service.jobs() == []
    assert time.monotonic() - start >= 1
    stand_in.faults.once("rate_limited", on=SUBMIT)
    with pytest.raises(IBMRuntimeError, match="429"):
        Sampler(backend).run([flip])


def test_the_client_repeats_a_submission_that_was_accepted(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.once("accepted_504")
    job = Sampler(backend).run([flip])
    assert len(stand_in.ledger().jobs) == 2
    assert stand_in.ledger().jobs[1].id == job.job_id()
    assert stand_in.ledger().faults == {"accepted_504": 1}


@pytest.mark.usefixtures("no_retries")
@pytest.mark.parametrize("kind", ["accepted_504", "accepted_dropped", "cut_answer"])
def test_a_job_is_accepted_although_the_client_sees_an_error(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit, kind: str
) -> None:
    stand_in.faults.once(kind, on=SUBMIT)
    with pytest.raises(IBMRuntimeError):
        Sampler(backend, options={"environment": {"job_tags": ["lost"]}}).run([flip])
    [found] = service.jobs(job_tags=["lost"])
    assert [found.job_id()] == [entry.id for entry in stand_in.ledger().jobs]
    assert isinstance(found.result(), PrimitiveResult)
    assert stand_in.ledger().faults == {kind: 1}


@pytest.mark.usefixtures("no_retries")
@pytest.mark.parametrize("kind", ["dropped", "cut_answer"])
def test_a_connection_ends(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit, kind: str
) -> None:
    job = Sampler(backend).run([flip])
    stand_in.faults.once(kind, on=RESULTS)
    with pytest.raises(RequestsApiError, match="Connection") as caught:
        job.result()
    assert caught.value.status_code == -1
    assert isinstance(job.result(), PrimitiveResult)
    assert stand_in.ledger().faults == {kind: 1}


def test_the_client_does_not_repeat_a_submission_that_was_dropped(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.once("dropped", on=SUBMIT)
    with pytest.raises(IBMRuntimeError, match="Connection aborted"):
        Sampler(backend).run([flip])
    assert stand_in.ledger().requests[SUBMIT] == 1
    assert stand_in.ledger().jobs == []


def test_a_job_fails(
    stand_in: StandIn, backend: Any, make_sampler: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.once("job_fails")
    job = make_sampler(backend).run([flip])
    with pytest.raises(RuntimeJobFailureError, match="Internal error"):
        job.result()
    assert job.usage() == 0
    [entry] = stand_in.ledger().jobs
    assert (entry.status, entry.charged_seconds) == ("Failed", 0)
    assert stand_in.ledger().faults == {"job_fails": 1}


def test_somebody_cancels_a_job(stand_in: StandIn, backend: Any, flip: QuantumCircuit) -> None:
    stand_in.faults.once("job_cancelled")
    job = Sampler(backend).run([flip])
    with pytest.raises(RuntimeInvalidStateError, match="cancelled"):
        job.result()
    assert job.usage() == 0


def test_a_job_waits_for_long(stand_in: StandIn, backend: Any, flip: QuantumCircuit) -> None:
    stand_in.faults.once("job_waits")
    job = Sampler(backend).run([flip])
    with pytest.raises(RuntimeJobTimeoutError):
        job.result(timeout=0.05, poll_interval=0.1)
    assert job.status() == "QUEUED"
    assert stand_in.ledger().faults == {"job_waits": 1}


@pytest.mark.parametrize("kind", ["results_truncated", "results_misshapen", "results_empty"])
def test_malformed_results(
    stand_in: StandIn, backend: Any, make_sampler: Any, flip: QuantumCircuit, kind: str
) -> None:
    stand_in.faults.once(kind, times=2)
    job = make_sampler(backend).run([flip])
    for _ in range(2):
        try:
            seen = job.result()
        except (TypeError, ValueError):  # the executor's decoder, where there is anything to read
            assert make_sampler.program == "executor"
            assert kind != "results_empty"
        else:  # no error at all: None, a text or a dict instead of a result
            assert not isinstance(seen, PrimitiveResult)
            assert (seen is None) == (kind == "results_empty")
    assert isinstance(job.result(), PrimitiveResult)
    assert stand_in.ledger().faults == {kind: 2}
    assert stand_in.ledger().jobs[0].results_fetched == 3


def test_faults_at_random_come_from_the_seed(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.chance("job_fails", 0.5)
    stand_in.faults.chance("results_empty", 1.0, fetches=2)
    jobs = [Sampler(backend).run([flip], shots=10) for _ in range(8)]
    time.sleep(0.05)
    done = [job for job in jobs if job.status() == "DONE"]
    assert 0 < len(done) < 8
    assert [done[0].result() is None for _ in range(4)] == [True, True, False, False]
    stand_in.faults.clear()
    assert done[1].result() is not None
    assert stand_in.ledger().faults == {"job_fails": 8 - len(done), "results_empty": 2}


def test_an_expired_token(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit
) -> None:
    job = Sampler(backend).run([flip])
    stand_in.faults.expire_tokens()
    with pytest.raises(IBMNotAuthorizedError, match="401"):
        service.job(job.job_id())
    with pytest.raises(QiskitBackendNotFoundError):  # the 401 of the list of backends is swallowed
        Sampler(backend).run([flip])
    assert isinstance(QiskitRuntimeService().job(job.job_id()).result(), PrimitiveResult)
    assert stand_in.ledger().faults["token_expired"] == 2


def test_tokens_expire_by_the_clock(stand_in: StandIn) -> None:
    stand_in.settings.token_seconds = 1
    service = QiskitRuntimeService()
    time.sleep(1.1)
    assert service.usage()  # the client asks for a new one in time
    assert stand_in.ledger().requests["POST /identity/token"] >= 2


def test_the_key_is_refused(stand_in: StandIn, service: Any) -> None:
    stand_in.faults.refuse_key()
    with pytest.raises(IBMNotAuthorizedError, match="401") as caught:
        service.usage()
    assert API_KEY not in str(caught.value)
    with pytest.warns(UserWarning, match="API key could not be found"):
        fresh = QiskitRuntimeService()  # no error: there are no backends, that is all
    assert fresh._backends_info_per_instance == {}
    assert stand_in.ledger().faults["key_refused"] >= 2
    stand_in.faults.refuse_key(False)
    assert service.usage()


def test_a_retired_backend(
    stand_in: StandIn, service: Any, backend: IBMBackend, flip: QuantumCircuit
) -> None:
    job = Sampler(backend).run([flip])
    stand_in.faults.retire("fake_lima")
    assert [found.name for found in service.backends()] == ["fake_toronto"]
    with pytest.raises(QiskitBackendNotFoundError):
        Sampler(backend).run([flip])
    with (
        pytest.warns(DeprecationWarning, match="SamplerV2"),
        pytest.raises(RequestsApiError, match="404"),
    ):
        SamplerV2(backend).run([flip])
    old = QiskitRuntimeService().job(job.job_id())
    assert isinstance(old.backend(), IBMRetiredBackend)
    assert isinstance(old.result(), PrimitiveResult)
    stand_in.faults.restore("fake_lima")
    assert QiskitRuntimeService().backend("fake_lima").num_qubits == 5


def test_a_new_job_is_missing_from_the_list_for_a_while(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.listing_lag_seconds = 0.3
    job = Sampler(backend).run([flip])
    assert service.jobs() == []
    assert service.job(job.job_id()).job_id() == job.job_id()
    time.sleep(0.3)
    assert [found.job_id() for found in service.jobs()] == [job.job_id()]
    assert stand_in.ledger().faults == {"listing_lag": 1}


def test_faults_are_ordered_over_http(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    orders = {
        "once": [{"kind": "job_fails", "times": 2}],
        "chance": [{"kind": "server_error", "probability": 0.0, "on": SUBMIT}],
        "retire": ["fake_toronto"],
        "listing_lag_seconds": 5,
    }
    _post(stand_in, orders)
    assert stand_in.faults.retired == {"fake_toronto"}
    assert stand_in.faults.listing_lag_seconds == 5
    jobs = [Sampler(backend).run([flip], shots=10) for _ in range(3)]
    time.sleep(0.05)
    assert [job.status() for job in jobs] == ["ERROR", "ERROR", "DONE"]
    _post(stand_in, {"clear": True})
    assert stand_in.faults.retired == set()
    with pytest.raises(urllib.error.HTTPError) as caught:
        _post(stand_in, {"once": [{"kind": "earthquake"}]})
    assert caught.value.code == 400
    caught.value.close()
    with pytest.raises(ValueError, match="earthquake"):
        stand_in.faults.once("earthquake")


def _post(stand_in: StandIn, body: dict[str, Any]) -> None:
    data = json.dumps(body).encode()
    url = f"{stand_in.url}/standin/faults"
    with urllib.request.urlopen(urllib.request.Request(url, data)) as answer:
        assert answer.status == 200
