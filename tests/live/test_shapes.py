"""Answers with the wrong shape are explained, and nothing is lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault, StandIn
from standin.errors import ApiError
from standin.server import Application
from standin.service import Service

from qcompile.errors import LiveError
from qcompile.live import GuardedSampler

from .sampled import flipped

STEP_S = 2.1792
CAP_S = 19


def reshape(
    monkeypatch: pytest.MonkeyPatch, route: str, change: Callable[[Any], Any], times: int = 10**9
) -> None:
    """Change the service's next `times` answers to a route with `change`."""
    from standin import server

    real, left = Application._handle, [times]

    def handle(self: Application, request: Any, name: str, found: Any) -> Any:
        response = real(self, request, name, found)
        if name != route or response.status_code != 200 or left[0] == 0:
            return response
        left[0] -= 1
        return server._json(change(response.get_json()))

    monkeypatch.setattr(Application, "_handle", handle)


WRONG: list[Callable[[Any], Any]] = [
    lambda body: None,
    lambda body: [],
    lambda body: {},
    lambda body: "text",
    lambda body: 5,
    lambda body: dict.fromkeys(body, None),
    lambda body: dict.fromkeys(body, "text"),
    lambda body: {key: [[]] for key in body},
]
ROUTES = (
    "GET /jobs",
    "GET /jobs/{id}",
    "POST /jobs",
    "GET /instances/usage",
    "GET /backends",
    "GET /backends/{id}/configuration",
)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("wrong", range(len(WRONG)))
def test_an_answer_of_another_shape_is_explained_or_harmless(
    runs: Runs,
    undisturbed: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    route: str,
    wrong: int,
) -> None:
    """The same run resumes from there once answers are right again."""
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.3)
    with monkeypatch.context() as patch:
        reshape(patch, route, WRONG[wrong])
        answer = runs.run()
    assert answer.code in (0, 1), answer.err
    if answer.code == 1:
        _, words = answer.err.split("Error: ")
        assert len(words.splitlines()[0]) < 400
        assert "Traceback" not in words
    begun = runs.call("runs", "--json").json()
    if not begun:
        return
    [row] = begun
    assert row["qpu_seconds"] >= runs.service.ledger().charged_seconds
    if answer.code == 1:
        answer = runs.call("resume", "last", "--json", "--yes")
    assert played(runs.until_finished(answer)) == undisturbed
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("more", [1, 7, 10**6])
def test_a_list_that_says_it_is_longer_than_it_is_ends_in_words(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch, more: int
) -> None:
    with monkeypatch.context() as patch:
        reshape(patch, "GET /jobs", lambda body: body | {"count": body["count"] + more})
        answer = runs.run()
    assert answer.code == 1
    assert (
        f"Error: IBM's service counts {more} jobs with one tag but lists 0.\n"
        "  A job may be missing, so nothing was sent or cancelled. Resume later.\n"
    ) in answer.err
    assert not runs.service.ledger().jobs
    assert runs.service.ledger().requests["GET /jobs"] == 1
    assert played(runs.until_finished(runs.call("resume", "last", "--json"))) == undisturbed


def test_a_list_of_several_pages_is_read_to_its_end(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.remote._PAGE", 1)
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(Fault.ACCEPTED_504, on="POST /jobs")
    assert runs.run().json()["jobs_in_doubt"] == 1
    runs.service.faults.listing_lag_seconds = 0
    found = runs.call("resume", "last", "--json").json()
    assert played(found) == undisturbed
    assert found["jobs_in_doubt"] == 0
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


def test_jobs_without_a_time_are_found_all_the_same(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_created(body: Any) -> Any:
        for job in body.get("jobs", [body]):
            job.pop("created", None)
        return body

    reshape(monkeypatch, "GET /jobs", without_created)
    runs.service.faults.once(Fault.ACCEPTED_504, on="POST /jobs", times=2)
    found = runs.run().json()
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert found["jobs_in_doubt"] == 0


CHARGES = [-1.0, -math.inf, math.inf, math.nan, 1e9, 10 * CAP_S + 1, True, "2.2", None, [2.2]]


@pytest.mark.parametrize("charge", range(len(CHARGES)))
def test_a_charge_that_cannot_be_is_not_believed(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch, charge: int
) -> None:
    """The cap counts instead."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    said = {"qpu_charge_time_seconds": CHARGES[charge], "status": "complete"}
    reshape(monkeypatch, "GET /jobs/{id}/metrics", lambda body: body | {"usage": said})
    found = runs.run().json()
    assert played(found) == undisturbed
    assert (found["qpu_seconds"], found["qpu_seconds_settled"]) == (3 * CAP_S, 0)
    assert found["jobs_uncharged"] == 3


def test_a_charge_above_the_cap_is_believed(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """IBM may round: counting less than it charges would be worse than counting too much."""
    said = {"qpu_charge_time_seconds": 25, "status": "complete"}
    reshape(monkeypatch, "GET /jobs/{id}/metrics", lambda body: body | {"usage": said}, times=1)
    found = runs.run(max_qpu_seconds=200).json()
    assert found["qpu_seconds"] == pytest.approx(25 + 2 * STEP_S)


@pytest.mark.parametrize(
    "change", [lambda body: None, lambda body: [], lambda body: {"usage": 5}, lambda body: "x"]
)
def test_metrics_of_another_shape_leave_the_counts(
    runs: Runs,
    undisturbed: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Any], Any],
) -> None:
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    with monkeypatch.context() as patch:
        reshape(patch, "GET /jobs/{id}/metrics", change)
        found = runs.run().json()
    assert played(found) == undisturbed
    assert (found["qpu_seconds"], found["jobs_uncharged"]) == (3 * CAP_S, 3)
    found = runs.call("resume", "last", "--json").json()
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


@pytest.mark.parametrize("status", [404, 403, 500])
def test_metrics_that_are_not_there_leave_the_counts(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    def metrics(self: Service, job: Any) -> Any:
        raise ApiError(status, 1291, "Not found.")

    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    with monkeypatch.context() as patch:
        patch.setattr(Service, "metrics", metrics)
        found = runs.run().json()
    assert played(found) == undisturbed
    assert (found["qpu_seconds"], found["jobs_uncharged"]) == (3 * CAP_S, 3)
    found = runs.call("resume", "last", "--json").json()
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    check_paid_once(runs.service, 3)


def test_a_failed_job_whose_results_are_not_there_is_sent_again(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Service.results

    def results(self: Service, job: Any) -> Any:
        if job.outcome == "Failed":
            raise ApiError(404, 1291, "Not found.")
        return real(self, job)

    monkeypatch.setattr(Service, "results", results)
    runs.service.faults.once(Fault.JOB_FAILS)
    found = runs.run()
    assert found.code == 0, found.err
    assert played(found.json()) == undisturbed
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("wrong", [{"qubits": None}, "text"])
def test_a_sampler_explains_properties_of_another_shape(
    service: StandIn, monkeypatch: pytest.MonkeyPatch, wrong: Any
) -> None:
    """They are read before the first job is sent; the same program is run again."""
    reshape(monkeypatch, "GET /backends/{id}/properties", lambda body: wrong, times=1)
    with GuardedSampler("fake_lima") as sampler:
        with pytest.raises(LiveError, match="the backend fake_lima"):
            sampler.run([flipped(0)], shots=100)
        assert not service.ledger().jobs
        sampler.run([flipped(0)], shots=100).result()
    assert len(service.ledger().jobs) == 1
