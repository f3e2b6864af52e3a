"""What an error of IBM's client means: whether to try again, and in words, without secrets."""

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
"""A service that does not answer is asked again for so long."""
NOT_FOUND, TOO_MANY_REQUESTS, UNAVAILABLE = 404, 429, 503
_LONGEST_S = 86_400.0
_REFUSED = frozenset(range(400, 500)) - {408, TOO_MANY_REQUESTS}
_SAVE = (
    'Save one: python -c "from getpass import getpass; from qiskit_ibm_runtime import '
    "QiskitRuntimeService as S; S.save_account(token=getpass('API key: '), instance='CRN')\"",
    "or set QISKIT_IBM_TOKEN and QISKIT_IBM_INSTANCE. docs/start/first-hardware.md has the steps.",
)
_TOKEN = re.compile(r"\beyJ[\w-]{5,}\.[\w-]+(?:\.[\w-]*)?|\b(?:Bearer|apikey) [\w.~+/=-]{16,}")
"""An access token, or what a request said in its header."""


def seconds_setting(name: str, default: float) -> float:
    """The seconds that an environment variable says, or the default.

    Raises:
        LiveError: it says something else.
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
            f"It needs a number of seconds, such as {default:g}, and a day's at most.",
        )
    return seconds


def transient(error: BaseException) -> bool:
    """Whether the same request may be answered a little later."""
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
    """Whether what was sent was not taken: by the service, or by the client before it was sent."""
    status = status_code(error)
    return status in _REFUSED if status is not None else not transient(error)


def answered_no(error: BaseException) -> bool:
    """Whether the service answered what was sent with a refusal, a 4xx."""
    return 400 <= (status_code(error) or 0) < 500


def never_left(error: BaseException) -> bool:
    """Whether there was no connection by which a request could have left this machine."""
    from urllib3.exceptions import ConnectTimeoutError, MaxRetryError, NewConnectionError

    reasons = [e.reason for e in chain_of(error) if isinstance(e, MaxRetryError)]
    no_connection = (ConnectTimeoutError, NewConnectionError)
    return any(isinstance(e, no_connection) for e in (*chain_of(error), *reasons))


def status_code(error: BaseException | None) -> int | None:
    """The HTTP status behind an error of the client, -1 without one; None where none was asked."""
    from ibm_cloud_sdk_core import ApiException
    from qiskit_ibm_runtime.api.exceptions import RequestsApiError
    from qiskit_ibm_runtime.exceptions import IBMNotAuthorizedError

    for cause in chain_of(error):
        if isinstance(cause, IBMNotAuthorizedError):
            return 401
        if isinstance(cause, ApiException):  # of the identity service, which answers 400 to a key
            return 401 if cause.status_code == 400 else int(cause.status_code)
        if isinstance(cause, RequestsApiError):
            return int(cause.status_code)
    return None


def retry_after_s(error: BaseException | None) -> float | None:
    """The seconds after which a busy service wants to be asked again; None where it says none.

    It says them in the Retry-After of a 429 or 503, as a number or as an HTTP date.
    """
    from urllib3.exceptions import InvalidHeader
    from urllib3.util.retry import Retry

    for cause in chain_of(error):
        # Of requests, and of the client of the identity service.
        for response in (getattr(cause, name, None) for name in ("response", "http_response")):
            if getattr(response, "status_code", None) in (TOO_MANY_REQUESTS, UNAVAILABLE):
                told = response.headers.get("Retry-After")  # type: ignore[union-attr]
                with suppress(InvalidHeader):
                    return None if told is None else float(Retry().parse_retry_after(told))
    return None


def duration(seconds: float) -> str:
    """A time of waiting, rounded up to what matters: 1 s, 3 min, 2 h 10 min."""
    if seconds < 100:
        return f"{math.ceil(seconds)} s"
    hours, minutes = divmod(math.ceil(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


def chain_of(error: BaseException | None) -> list[BaseException]:
    """The error and what it came from; the client hides its causes with `from None`."""
    chain: list[BaseException] = []
    cause = error
    while cause is not None and cause not in chain:
        chain.append(cause)
        cause = cause.__cause__ or cause.__context__
    return chain


class DetachedErrors:
    """A block whose errors come without the one that its caller handles.

    Python chains the two. But who sends a job while he handles an older error, of a request that
    never left, say, would have that one speak for the new request.
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
    """What happened, without what is secret, and what to try."""
    from qiskit_ibm_runtime.accounts.exceptions import AccountNotFoundError

    if isinstance(error, LookupError | TypeError | AttributeError):  # in the client's reading
        return UnreadableAnswerError("what was asked or sent")
    _clean(error)
    quotation = quoted(str(error))
    if isinstance(error, AccountNotFoundError):
        saved = ", ".join(saved_accounts())
        if saved:
            return LiveError(
                "There is no such account.", f"It says: {quotation}", f"Saved are: {saved}."
            )
        return LiveError("No account of IBM Quantum is saved on this machine.", *_SAVE)
    if status_code(error) == 401:
        return LiveError(
            "IBM refuses the account's token: it has expired, or is not of this instance.",
            f"IBM says: {quotation}",
            "Make a new one on quantum.cloud.ibm.com and save it over the old (overwrite=True).",
        )
    if transient(error):
        if seconds := retry_after_s(error):
            return LiveError(
                f"IBM's service is busy and asks to come back in {duration(seconds)}.",
                f"Last it said: {quotation}",
                "Nothing is lost: resume then.",
            )
        return LiveError(
            "IBM's service does not answer.",
            f"Last it said: {quotation}",
            "Nothing is lost: resume later.",
        )
    return LiveError(
        "IBM's service or client refuses.",
        f"It says: {quotation}",
        "Look at --backend, --account, --instance; `qcompile plan --live` tries them at no cost.",
    )


def _clean(error: BaseException) -> None:
    """Take what is secret out of an error and its causes: a traceback shows them all."""
    for cause in chain_of(error):
        cause.args = tuple(
            without_secrets(arg) if isinstance(arg, str) else arg for arg in cause.args
        )
        if isinstance(message := getattr(cause, "message", None), str):
            with suppress(AttributeError):  # it may be computed from what is cleaned above
                cause.message = without_secrets(message)  # type: ignore[attr-defined]


def quoted(text: str, most: int = 300) -> str:
    """What a service said, as one line of at most `most` characters, without what is secret."""
    return one_line(without_secrets(one_line(text, len(text))), most)


def without_secrets(words: str) -> str:
    """`words` without access tokens, and without any token of the accounts on this machine."""
    secrets = [os.environ.get("QISKIT_IBM_TOKEN", "")]
    if sys.modules.get("qiskit_ibm_runtime"):  # nothing else reads those that are saved
        secrets += [str(account.get("token", "")) for account in saved_accounts().values()]
    for secret in filter(None, secrets):
        words = words.replace(secret, "(token)")
    return _TOKEN.sub("(token)", words)


def saved_accounts() -> dict[str, dict[str, Any]]:
    """The accounts that IBM's tools keep on this machine, by name."""
    from qiskit_ibm_runtime import QiskitRuntimeService

    try:
        return dict(QiskitRuntimeService.saved_accounts())
    except (OSError, ValueError):
        return {}
