"""Invalid answers: what the raw client sees of each kind."""

from __future__ import annotations

import math
from typing import Any

import pytest
import requests
from qiskit import QuantumCircuit
from qiskit_ibm_runtime import QiskitRuntimeService
from qiskit_ibm_runtime.executor_sampler import Sampler
from standin import API_KEY, CHARGES, TROUBLES, Fault, Reshape, StandIn
from standin.answers import reshaped

SUBMIT, LIST, METRICS = "POST /jobs", "GET /jobs", "GET /jobs/{id}/metrics"


def answer() -> dict[str, Any]:
    return {"jobs": [{"id": "a", "tags": ["x"]}, {"id": "b"}], "count": 2}


@pytest.mark.parametrize(
    ("rule", "expected", "struck"),
    [
        (Reshape(on=LIST, to=[]), [], True),
        (Reshape(on=LIST, at=("count",), to="two"), answer() | {"count": "two"}, True),
        (Reshape(on=LIST, at=("count",), drop=True), {"jobs": answer()["jobs"]}, True),
        (
            Reshape(on=LIST, at=("jobs", "*", "tags"), drop=True),
            {"jobs": [{"id": "a"}, {"id": "b"}], "count": 2},
            True,
        ),
        (Reshape(on=LIST, at=("jobs", "*", "created")), answer(), False),
        (Reshape(on=LIST, at=("rows", "*")), answer(), False),
    ],
)
def test_a_rule_changes_what_lies_at_its_path(rule: Reshape, expected: Any, struck: bool) -> None:
    assert reshaped(answer(), rule) == (expected, struck)


def test_a_rule_changes_so_many_answers(stand_in: StandIn, service: Any) -> None:
    stand_in.faults.reshape(Reshape(on=LIST, at=("jobs",), drop=True, times=2))
    for _ in range(2):
        with pytest.raises(KeyError, match="jobs"):
            service.jobs()
    assert service.jobs() == []
    assert stand_in.ledger().faults == {"reshaped": 2}


def test_charges_that_no_job_can_have(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    job = Sampler(backend).run([flip])
    seen = []
    for rule in CHARGES.values():
        stand_in.faults.clear()
        stand_in.faults.reshape(rule)
        seen.append(job.metrics()["usage"]["qpu_charge_time_seconds"])
    assert [repr(value) for value in seen] == [repr(rule.to) for rule in CHARGES.values()]
    assert any(isinstance(value, float) and math.isnan(value) for value in seen)


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 413, 429])
def test_a_job_is_accepted_although_it_is_refused(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit, status: int
) -> None:
    stand_in.faults.retry_after_seconds = 0
    stand_in.faults.once(f"accepted_{status}", on=SUBMIT)
    with pytest.raises(Exception, match=f"{status}"):
        Sampler(backend, options={"environment": {"job_tags": ["lost"]}}).run([flip])
    assert len(stand_in.ledger().jobs) == 1
    assert [job.job_id() for job in service.jobs(job_tags=["lost"])] == [
        stand_in.ledger().jobs[0].id
    ]


@pytest.mark.parametrize("kind", [Fault.TAGS_IGNORED, Fault.TAGS_HIDDEN])
def test_the_filter_of_tags_is_ignored(
    stand_in: StandIn, service: Any, backend: Any, flip: QuantumCircuit, kind: Fault
) -> None:
    for tag in ("mine", "yours"):
        Sampler(backend, options={"environment": {"job_tags": [tag]}}).run([flip])
    stand_in.faults.once(kind, on=LIST)
    seen = [job.tags for job in service.jobs(job_tags=["mine"])]
    assert seen == ([["yours"], ["mine"]] if kind is Fault.TAGS_IGNORED else [None, None])
    assert len(service.jobs(job_tags=["mine"])) == 1


def test_a_failed_job_that_is_charged_and_whose_reason_is_gone(
    stand_in: StandIn, backend: Any, flip: QuantumCircuit
) -> None:
    stand_in.faults.once(Fault.JOB_FAILS_CHARGED)
    job = Sampler(backend).run([flip])
    stand_in.faults.once(Fault.REASON_MISSING)
    with pytest.raises(Exception, match="404"):
        job.result()
    [entry] = stand_in.ledger().jobs
    assert entry.status == "Failed"
    assert entry.charged_seconds > 2


def test_errors_may_repeat_what_was_sent(stand_in: StandIn) -> None:
    stand_in.faults.echo_secrets, stand_in.faults.suffix = True, "\x1b[31m"
    headers = {"Authorization": "Bearer one.two.three"}
    refused = requests.get(f"{stand_in.url}/experimental/jobs", headers=headers, timeout=5)
    assert refused.status_code == 401
    assert "Authorization: Bearer one.two.three" in refused.json()["errors"][0]["message"]
    assert "\x1b[31m" in refused.json()["errors"][0]["message"]
    refused = requests.post(f"{stand_in.url}/identity/token", data={"apikey": "wrong"}, timeout=5)
    assert refused.status_code == 400
    assert "apikey=wrong" in refused.text
    assert stand_in.ledger().faults == {"secrets_echoed": 2}


def test_secrets_are_the_key_and_the_parts_of_all_tokens(stand_in: StandIn) -> None:
    given = requests.post(f"{stand_in.url}/identity/token", data={"apikey": API_KEY}, timeout=5)
    token = given.json()["access_token"]
    assert stand_in.secrets() == [API_KEY, *token.split(".")[1:]]


def test_the_service_recovers(stand_in: StandIn) -> None:
    """After any trouble it answers as before."""
    usage = QiskitRuntimeService().usage()
    for trouble in TROUBLES.values():
        trouble.begin(stand_in)
    stand_in.recover()
    service = QiskitRuntimeService()  # tokens of before have expired
    assert service.usage() == usage
    assert service.jobs() == []
    assert stand_in.settings.usage_lag_seconds == 0
    assert stand_in.ledger().faults == {}
