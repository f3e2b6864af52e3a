"""IBM's client, made safe: it repeats no submission, waits for no answer for ever, and logs in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qcompile.live.client_errors import DetachedErrors, never_left

_TIMEOUT_S = (5.0, 60.0)
"""To connect, and between two pieces of an answer; by itself the client waits for ever."""


def clients(service: Any) -> list[Any]:
    """The client of each instance, that in use first."""
    return list(dict.fromkeys([service._active_api_client, *service._api_clients.values()]))


def log_in(service: Any) -> None:
    """Have each client hold a new token.

    By itself a client that got none waits for a minute before each of its next requests.
    """
    for client in clients(service):
        manager = getattr(client._session.auth, "tm", None)
        if manager is not None:
            manager.expire_time = manager.request_time = 0
            manager.get_token()


def make_safe(service: Any, count: Callable[[int], None]) -> None:
    """Let the clients repeat what reads, and nothing else; and let no answer hang.

    By themselves they repeat a POST that was answered with 504, though the job may have been
    accepted, and sleep for as long as a Retry-After says. `count` gets 1 for each submission, and
    -1 where it has not left this machine.
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
