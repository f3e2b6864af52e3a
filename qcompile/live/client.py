"""IBM's client, made safe: it never repeats a submission, never waits forever, and logs in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qcompile.live.client_errors import DetachedErrors, never_left

_TIMEOUT_S = (5.0, 60.0)
"""Timeouts to connect and between pieces of an answer; by default the client waits forever."""


def clients(service: Any) -> list[Any]:
    """The client of each instance, the one in use first."""
    return list(dict.fromkeys([service._active_api_client, *service._api_clients.values()]))


def log_in(service: Any) -> None:
    """Give each client a new token.

    Without this, a client that failed to get one waits a minute before each following request.
    """
    for client in clients(service):
        manager = getattr(client._session.auth, "tm", None)
        if manager is not None:
            manager.expire_time = manager.request_time = 0
            manager.get_token()


def make_safe(service: Any, count: Callable[[int], None]) -> None:
    """Make the clients retry reads only, and time out instead of hanging.

    By default they retry a POST that was answered with 504, though the job may have been accepted,
    and sleep for as long as Retry-After says. `count` gets 1 for each submission, and -1 if it
    never left this machine.
    """
    from requests.adapters import HTTPAdapter
    from urllib3.util.retry import Retry

    class Adapter(HTTPAdapter):
        def send(self, request: Any, *args: Any, **options: Any) -> Any:
            path, _, _ = request.path_url.partition("?")
            submits = request.method == "POST" and path.endswith("/jobs")
            count(submits)
            try:
                with DetachedErrors():
                    return super().send(request, *args, **options)
            except OSError as error:
                count(-(submits and never_left(error)))
                raise

    retry = Retry(
        total=3,
        connect=3,
        backoff_factor=0.2,
        status_forcelist=(500, 502, 504),
        respect_retry_after_header=False,
    )
    for client in clients(service):
        session = client._session
        session._timeout = _TIMEOUT_S
        session.mount(session.base_url, Adapter(max_retries=retry))
