"""The HTTP of the stand-in: routes, authorisation, and the faults around every answer."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from http import HTTPStatus
from typing import Any

from pydantic import ValidationError
from werkzeug.exceptions import HTTPException
from werkzeug.http import http_date
from werkzeug.routing import Map, Rule
from werkzeug.wrappers import Request, Response

from .answers import SUBMIT
from .errors import ApiError
from .faults import (
    ACCEPTED_STATUS,
    AFTER_ACCEPTING,
    BEFORE,
    STATUS,
    Fault,
    Faults,
    Orders,
)
from .identity import Identity
from .jobs import Ledger
from .service import Service

API = "/experimental"
"""The client takes a URL as it is only where it holds this word."""

Answer = Response | dict[str, Any] | None


class Application:
    """The WSGI application: each request is counted, struck by a fault or answered."""

    def __init__(self, service: Service, identity: Identity, faults: Faults):
        self._service = service
        self._identity = identity
        self._faults = faults
        self.requests: Counter[str] = Counter()
        self.defects: list[Exception] = []
        """Errors of the stand-in itself; each was answered with 500."""
        self._lock = threading.Lock()
        self._handlers = self._routes()
        self._map = Map([_rule(name) for name in self._handlers])

    def ledger(self) -> Ledger:
        with self._lock:
            requests = dict(sorted(self.requests.items()))
        return Ledger(
            jobs=self._service.entries(),
            requests=requests,
            faults=dict(sorted(self._faults.counts.items())),
        )

    def __call__(self, environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:
        request = Request(environ)
        try:
            name, found = self._map.bind_to_environ(environ).match()
        except HTTPException as error:
            return error(environ, start_response)
        response = self._respond(request, name, found)
        if response is None:
            _hang_up(environ)
            response = Response(status=HTTPStatus.BAD_GATEWAY)
        return response(environ, start_response)

    def _respond(self, request: Request, name: str, found: Mapping[str, Any]) -> Response | None:
        """The answer, or None if the connection is to end without one."""
        if request.path.startswith("/standin/"):
            return self._handle(request, name, found)
        with self._lock:
            self.requests[name] += 1
        # The body is read in any case: a client that is still sending sees a broken pipe.
        request.get_data()
        fault = self._faults.strike(BEFORE, name)
        if fault is not None:
            self._faults.record(fault)
            return None if fault is Fault.DROPPED else self._failure(request, fault)
        response = self._handle(request, name, found)
        if response.status_code >= HTTPStatus.BAD_REQUEST:
            return response
        if name == SUBMIT and (fault := self._faults.strike(AFTER_ACCEPTING, name)):
            self._faults.record(fault)
            if fault is Fault.ACCEPTED_DROPPED:
                return None
            return self._failure(request, fault)
        if response.is_json and self._faults.reshapes(name):
            answer, changed = self._faults.reshaped(name, response.get_json())
            if changed:
                self._faults.record("reshaped")
                response = _json(answer)
        body = response.get_data()
        if len(body) > 1 and self._faults.strike((Fault.CUT_ANSWER,), name):
            self._faults.record(Fault.CUT_ANSWER)
            response.set_data(body[: len(body) // 2])
            response.content_length = len(body)
        return response

    def _failure(self, request: Request, fault: Fault) -> Response:
        status = (STATUS | ACCEPTED_STATUS)[fault]
        told = status in (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE)
        seconds = self._faults.retry_after_seconds if told else None
        error = ApiError(status, status, f"The service failed: {fault}.", seconds)
        return self._refusal(request, error)

    def _refusal(self, request: Request, error: ApiError) -> Response:
        """The answer of an error, with what `Faults` adds to its words."""
        words = [str(error), self._faults.suffix]
        if self._faults.echo_secrets:
            self._faults.record("secrets_echoed")
            words += [f"You sent {name}: {value}" for name, value in request.headers.items()]
            words += [f"{name}={value}" for name, value in request.form.items()]
        said = ApiError(error.status, error.code, " ".join(filter(None, words)))
        response = _json(said.body(), error.status)
        if error.retry_after_seconds is not None:
            response.headers["Retry-After"] = self._retry_after(error.retry_after_seconds)
        return response

    def _retry_after(self, seconds: float) -> str:
        """Whole seconds, or an HTTP date; never a time too early."""
        if not self._faults.retry_after_is_a_date:
            return str(math.ceil(seconds))
        return http_date(math.ceil(time.time() + seconds))

    def _handle(self, request: Request, name: str, found: Mapping[str, Any]) -> Response:
        try:
            if request.path.startswith(API):
                headers = request.headers
                self._identity.check(
                    headers.get("Authorization", ""), headers.get("Service-CRN", "")
                )
            answer = self._handlers[name](request, **found)
        except ApiError as error:
            return self._refusal(request, error)
        except HTTPException as error:  # werkzeug's own, of a body that is not JSON
            return Response(error.description, status=error.code)
        except Exception as error:
            self.defects.append(error)
            return self._refusal(request, ApiError(500, 500, f"The service failed: {error!r}."))
        if answer is None:
            return Response(status=HTTPStatus.NO_CONTENT)
        return answer if isinstance(answer, Response) else _json(answer)

    def _routes(self) -> dict[str, Callable[..., Answer]]:
        service = self._service
        return {
            "POST /identity/token": self._token,
            "GET /standin/ledger": lambda _: _json_text(self.ledger().model_dump_json()),
            "POST /standin/faults": self._order_faults,
            "GET /instances/usage": lambda _: service.usage(),
            "GET /backends": lambda _: service.backends(),
            "GET /backends/{id}/configuration": lambda _, id: service.machine(id).configuration,
            "GET /backends/{id}/properties": lambda _, id: service.machine(id).properties,
            "GET /backends/{id}/status": lambda _, id: service.status(id),
            SUBMIT: self._submit,
            "GET /jobs": self._list_jobs,
            "GET /jobs/{id}": self._job,
            "DELETE /jobs/{id}": lambda _, id: service.delete(service.job(id)),
            "GET /jobs/{id}/results": self._results,
            "GET /jobs/{id}/metrics": lambda _, id: service.metrics(service.job(id)),
            "GET /jobs/{id}/logs": self._logs,
            "POST /jobs/{id}/cancel": lambda _, id: service.cancel(service.job(id)),
            "PUT /jobs/{id}/tags": self._set_tags,
            "POST /sessions": lambda request: service.open_batch(request.get_json()),
            "GET /sessions/{id}": lambda _, id: service.batch(id),
            "PATCH /sessions/{id}": self._close_batch,
            "DELETE /sessions/{id}/close": lambda _, id: service.close_batch(id, cancel_jobs=True),
        }

    def _token(self, request: Request) -> Answer:
        return self._identity.token(request.form.get("apikey"))

    def _order_faults(self, request: Request) -> Answer:
        try:
            self._faults.order(Orders.model_validate_json(request.get_data()))
        except ValidationError as error:
            raise ApiError(400, 400, str(error)) from error
        return {"faults": dict(self._faults.counts)}

    def _submit(self, request: Request) -> Answer:
        job = self._service.submit(request.get_json())
        return {"id": job.id, "backend": job.backend, "session_id": job.session_id}

    def _list_jobs(self, request: Request) -> Answer:
        return self._service.jobs(request.args.to_dict(), request.args.getlist("tags"))

    def _job(self, request: Request, id: str) -> Answer:
        with_params = request.args.get("exclude_params") != "true"
        return self._service.describe(self._service.job(id), with_params=with_params)

    def _results(self, _: Request, id: str) -> Answer:
        body = self._service.results(self._service.job(id))
        return None if body is None else _json_text(body)

    def _logs(self, _: Request, id: str) -> Answer:
        logs = self._service.logs(self._service.job(id))
        return None if logs is None else Response(logs, content_type="text/plain")

    def _set_tags(self, request: Request, id: str) -> Answer:
        self._service.job(id).tags[:] = request.get_json()["tags"]
        return None

    def _close_batch(self, request: Request, id: str) -> Answer:
        if request.get_json().get("accepting_jobs") is False:
            self._service.close_batch(id)
        return None


def _rule(name: str) -> Rule:
    method, _, path = name.partition(" ")
    prefix = "" if path.startswith(("/identity/", "/standin/")) else API
    path = path.replace("{id}", "<id>")
    return Rule(f"{prefix}{path}", methods=[method], endpoint=name)


def _json(body: Any, status: int = HTTPStatus.OK) -> Response:
    return _json_text(json.dumps(body), status)


def _json_text(body: str, status: int = HTTPStatus.OK) -> Response:
    return Response(body, status=status, content_type="application/json")


def _hang_up(environ: dict[str, Any]) -> None:
    """End the connection; anything the server still writes is silently lost."""
    environ["werkzeug.socket"].shutdown(socket.SHUT_RDWR)
