"""Errors of IBM's client: whether to retry, and an explanation without secrets."""

from __future__ import annotations

import math
import os
import re
import sys
from contextlib import suppress
from typing import Any

from qcompile.errors import LiveError
from qcompile.live.answers import UnreadableAnswerError
from qcompile.terminal import one_line

PATIENCE_S = 300.0
"""How long a service that does not answer is asked again, in seconds."""
NOT_FOUND, TOO_MANY_REQUESTS, UNAVAILABLE = 404, 429, 503
_LONGEST_S = 86_400.0
_REFUSED = frozenset(range(400, 500)) - {408, TOO_MANY_REQUESTS}
_SAVE = (
    'Save one: python -c "from getpass import getpass; from qiskit_ibm_runtime import '
    "QiskitRuntimeService as S; S.save_account(token=getpass('API key: '), instance='CRN')\"",
    "or set QISKIT_IBM_TOKEN and QISKIT_IBM_INSTANCE. docs/start/first-hardware.md has the steps.",
)
_TOKEN = re.compile(r"\beyJ[\w-]{5,}\.[\w-]+(?:\.[\w-]*)?|\b(?:Bearer|apikey) [\w.~+/=-]{16,}")
"""An access token, or the authorization header of a request."""


def seconds_setting(name: str, default: float) -> float:
    """The seconds in an environment variable, or the default.

    Raises:
        LiveError: its value is not a valid number of seconds.
    """
    text = os.environ.get(name)
    if text is None:
        return default
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 <= seconds <= _LONGEST_S:
        raise LiveError(
            f"{name} is {text[:40]!r}.",
            f"It must be a number of seconds, such as {default:g}, and at most a day.",
        )
    return seconds


def transient(error: BaseException) -> bool:
    """Whether the same request may succeed a little later."""
    from requests import ConnectionError, Timeout
    from requests.exceptions import ChunkedEncodingError, JSONDecodeError

    status = status_code(error)
    if status is not None:
        return status not in _REFUSED
    return any(
        isinstance(cause, ConnectionError | Timeout | ChunkedEncodingError | JSONDecodeError)
        for cause in chain_of(error)
    )


def refused(error: BaseException) -> bool:
    """Whether a request was refused by the service, or by the client before it was sent."""
    status = status_code(error)
    return status in _REFUSED if status is not None else not transient(error)


def answered_no(error: BaseException) -> bool:
    """Whether the service answered with a refusal, a 4xx."""
    return 400 <= (status_code(error) or 0) < 500


def never_left(error: BaseException) -> bool:
    """Whether the request cannot have left this machine, for want of a connection."""
    from urllib3.exceptions import ConnectTimeoutError, MaxRetryError, NewConnectionError

    reasons = [e.reason for e in chain_of(error) if isinstance(e, MaxRetryError)]
    no_connection = (ConnectTimeoutError, NewConnectionError)
    return any(isinstance(e, no_connection) for e in (*chain_of(error), *reasons))


def status_code(error: BaseException | None) -> int | None:
    """The HTTP status behind a client error, -1 without one; None if nothing was requested."""
    from ibm_cloud_sdk_core import ApiException
    from qiskit_ibm_runtime.api.exceptions import RequestsApiError
    from qiskit_ibm_runtime.exceptions import IBMNotAuthorizedError

    for cause in chain_of(error):
        if isinstance(cause, IBMNotAuthorizedError):
            return 401
        if isinstance(cause, ApiException):  # the identity service answers 400 to a bad key
            return 401 if cause.status_code == 400 else int(cause.status_code)
        if isinstance(cause, RequestsApiError):
            return int(cause.status_code)
    return None


def retry_after_s(error: BaseException | None) -> float | None:
    """The seconds after which a busy service wants to be asked again; None if it does not say.

    They come from the Retry-After of a 429 or 503, a number or an HTTP date.
    """
    from urllib3.exceptions import InvalidHeader
    from urllib3.util.retry import Retry

    for cause in chain_of(error):
        # The attribute names of requests and of the identity service's client.
        for response in (getattr(cause, name, None) for name in ("response", "http_response")):
            if getattr(response, "status_code", None) in (TOO_MANY_REQUESTS, UNAVAILABLE):
                header = response.headers.get("Retry-After")  # type: ignore[union-attr]
                with suppress(InvalidHeader):
                    return None if header is None else float(Retry().parse_retry_after(header))
    return None


def duration(seconds: float) -> str:
    """A waiting time in words, rounded up: 1 s, 3 min, 2 h 10 min."""
    if seconds < 100:
        return f"{math.ceil(seconds)} s"
    hours, minutes = divmod(math.ceil(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


def chain_of(error: BaseException | None) -> list[BaseException]:
    """The error and its causes; the client hides some with `from None`."""
    chain: list[BaseException] = []
    cause = error
    while cause is not None and cause not in chain:
        chain.append(cause)
        cause = cause.__cause__ or cause.__context__
    return chain


class DetachedErrors:
    """A block whose errors are not chained to the one that its caller is handling.

    Python chains the two. A program that sends a job while handling an older error, such as that of
    a request that never left, would otherwise have the old error decide about the new request.
    """

    def __enter__(self) -> None:
        self._handled = sys.exception()

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        causes = [error]
        for cause in causes:
            if cause is None or self._handled is None:
                continue
            if cause.__context__ is self._handled:
                cause.__context__ = None
            more = (cause.__cause__, cause.__context__)
            causes += [other for other in more if other not in causes]


def explain_error(error: BaseException) -> LiveError:
    """An error that says what happened, without secrets, and what to try."""
    from qiskit_ibm_runtime.accounts.exceptions import AccountNotFoundError

    if isinstance(error, LookupError | TypeError | AttributeError):  # while it reads an answer
        return UnreadableAnswerError("a request")
    _clean(error)
    quotation = quoted(str(error))
    if isinstance(error, AccountNotFoundError):
        saved = ", ".join(saved_accounts())
        if saved:
            return LiveError(
                "There is no such account.",
                f"IBM's client says: {quotation}",
                f"Saved accounts: {saved}.",
            )
        return LiveError("No account of IBM Quantum is saved on this machine.", *_SAVE)
    if status_code(error) == 401:
        return LiveError(
            "IBM refuses the account's token: it has expired, or belongs to another instance.",
            f"IBM says: {quotation}",
            "Create a new one on quantum.cloud.ibm.com and save it over the old one "
            "(overwrite=True).",
        )
    if transient(error):
        if seconds := retry_after_s(error):
            return LiveError(
                f"IBM's service is busy and asks to be called again in {duration(seconds)}.",
                f"The last answer was: {quotation}",
                "Nothing is lost: resume then.",
            )
        return LiveError(
            "IBM's service does not answer.",
            f"The last answer was: {quotation}",
            "Nothing is lost: resume later.",
        )
    return LiveError(
        "IBM's service or client refused the request.",
        f"It says: {quotation}",
        "Check --backend, --account and --instance; `qcompile plan --live` tries them for free.",
    )


def _clean(error: BaseException) -> None:
    """Remove secrets from an error and its causes: a traceback shows them all."""
    for cause in chain_of(error):
        cause.args = tuple(
            without_secrets(arg) if isinstance(arg, str) else arg for arg in cause.args
        )
        if isinstance(message := getattr(cause, "message", None), str):
            with suppress(AttributeError):  # it may be computed from the arguments cleaned above
                cause.message = without_secrets(message)  # type: ignore[attr-defined]


def quoted(text: str, most: int = 300) -> str:
    """A service's message as one line of at most `most` characters, without secrets."""
    return one_line(without_secrets(one_line(text, len(text))), most)


def without_secrets(words: str) -> str:
    """`words` without access tokens, and without any token of the accounts on this machine."""
    secrets = [os.environ.get("QISKIT_IBM_TOKEN", "")]
    if sys.modules.get("qiskit_ibm_runtime"):  # nothing else reads the saved ones
        secrets += [str(account.get("token", "")) for account in saved_accounts().values()]
    for secret in filter(None, secrets):
        words = words.replace(secret, "(token)")
    return _TOKEN.sub("(token)", words)


def saved_accounts() -> dict[str, dict[str, Any]]:
    """The accounts that IBM's tools have saved on this machine, by name."""
    from qiskit_ibm_runtime import QiskitRuntimeService

    try:
        return dict(QiskitRuntimeService.saved_accounts())
    except (OSError, ValueError):
        return {}
