"""IBM's service through qiskit-ibm-runtime: the account, the backend, and readable errors."""

from __future__ import annotations

import logging
import math
import time
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeVar

from qcompile.device import Device
from qcompile.errors import LiveError, MissingExtraError, QcompileError
from qcompile.live import client_errors
from qcompile.live.answers import UnreadableAnswerError
from qcompile.live.client import clients, log_in, make_safe
from qcompile.live.client_errors import (
    DetachedErrors,
    duration,
    explain_error,
    retry_after_s,
    seconds_setting,
    transient,
)
from qcompile.snapshot import device_from_backend

T = TypeVar("T")

_LOOKS, _PAUSE_S = 3, 0.5
_LOGINS = 3
"""How often an expired token is renewed before the error is reported."""
_FREE = ["open"]


class Connection:
    """A connection to one backend of an account saved by IBM's tools (`account`, or the default).

    It opens on first use. Without `instance`, and if the account names none, only instances of the
    free Open Plan are considered. The client never repeats a request that submits a job: it might
    submit twice. `submissions` counts the submissions that left this machine. Requests are retried
    for `patience_s` seconds, by default QCOMPILE_PATIENCE_SECONDS, and `say` gets a message; a busy
    service is not asked again before the time in its Retry-After. With `given`, an IBMBackend, that
    backend and its service are used, and its client stops repeating submissions.
    """

    def __init__(
        self,
        backend: str,
        account: str | None = None,
        instance: str | None = None,
        *,
        patience_s: float | None = None,
        given: Any = None,
        say: Callable[[str], None] = lambda words: None,
    ):
        if not backend:
            raise LiveError("The backend has no name.", "Name a machine of the account.")
        self.name, self._account, self._instance = backend, account, instance
        usual_s = seconds_setting("QCOMPILE_PATIENCE_SECONDS", client_errors.PATIENCE_S)
        self._patience_s = usual_s if patience_s is None else patience_s
        self._given: Any = given
        self._say = say
        self._service: Any = None
        self._backend: Any = None
        self.submissions = 0

    @property
    def service(self) -> Any:
        """The QiskitRuntimeService.

        Raises:
            LiveError: there is no account, or it is refused, or the service does not answer.
            MissingExtraError: qiskit-ibm-runtime is not installed.
        """
        if self._service is None:
            _check_extra()
            self._service = self._patient(self._open)
        return self._service

    @property
    def backend(self) -> Any:
        """The IBMBackend.

        Raises:
            LiveError: the account has no such backend.
        """
        if self._backend is None:
            self._backend = self.ask(self._find, about=f"the backend {self.name}")
        return self._backend

    def device(self) -> Device:
        """The backend's qubits with their current calibration.

        Raises:
            DeviceError: its calibration cannot be read as a device.
            LiveError: as for `backend`.
        """
        backend = self.backend
        return self.ask(
            lambda service: device_from_backend(backend, self.name),
            about=f"the backend {self.name}",
        )

    def target(self) -> Any:
        """The backend's instructions, as Qiskit's Target.

        Raises:
            LiveError: as for `backend`.
        """
        backend = self.backend
        return self.ask(lambda service: backend.target, about=f"the backend {self.name}")

    def ask(
        self, question: Callable[[Any], T], *, about: str = "the account", patient: bool = True
    ) -> T:
        """The result of `question`, called with the service; it must only read.

        It is called again while the service is busy or unreachable, if `patient`, and after a new
        login if the token has expired, a few times at most. `about` names the subject in errors.

        Raises:
            LiveError: no answer in time, or a refusal.
            UnreadableAnswerError: the client cannot read the answer.
        """
        from qiskit_ibm_runtime.exceptions import IBMNotAuthorizedError

        service = self.service
        for _ in range(_LOGINS):
            try:
                return self._patient(lambda: question(service), about, patient)
            except LiveError as error:
                if not isinstance(error.__cause__, IBMNotAuthorizedError):
                    raise
            self.log_in_again()
        return self._patient(lambda: question(service), about, patient)

    def refresh_backend(self) -> None:
        """Look the backend up again.

        Raises:
            LiveError: the account no longer has it.
        """
        self._backend = None
        self.backend  # noqa: B018

    def log_in_again(self) -> None:
        """Get a new token.

        Raises:
            LiveError: IBM refuses one.
        """
        service = self.service
        self._patient(lambda: log_in(service))

    @property
    def crn(self) -> str:
        """The instance that the backend is used through."""
        return str(self.backend._instance)

    def left_on_plan_s(self) -> float | None:
        """QPU seconds left on the plan; None if IBM does not say."""
        self.refresh_backend()  # the client answers for the instance it used last

        def ask(service: Any) -> float | None:
            remaining_s = service.usage().get("usage_remaining_seconds")
            return None if remaining_s is None or math.isnan(remaining_s) else float(remaining_s)

        return self.ask(ask, about="the time left on the plan")

    def _open(self) -> Any:
        from qiskit_ibm_runtime import QiskitRuntimeService

        if self._given is not None:
            service = self._given.service
        else:
            logging.getLogger("qiskit_ibm_runtime").setLevel(logging.CRITICAL)
            service = QiskitRuntimeService(
                name=self._account, instance=self._instance, plans_preference=_FREE
            )
        try:
            log_in(service)
            self._make_safe(service)
        except AttributeError as error:
            raise LiveError(
                "This version of qiskit-ibm-runtime is untested: it might submit a job twice.",
                "Install the tested version: pip install -c constraints.txt 'qcompile[ibm]'",
            ) from error
        return service

    def _find(self, service: Any) -> Any:
        from qiskit.providers.exceptions import QiskitBackendNotFoundError

        if self._given is not None:
            given, self._given = self._given, None  # used once; a later lookup goes by name
            return given
        for _ in range(_LOOKS):
            try:
                backend = service.backend(self.name)
            except QiskitBackendNotFoundError as error:
                missing = error
            else:
                self._make_safe(service)  # the client may have made another session for it
                return backend
            # The client raises this too when the list, or the backend's own data, did not arrive.
            known = {
                data["name"] for client in clients(service) for data in client.list_backends(True)
            }
            if self.name not in known:
                raise LiveError(
                    f"The account has no backend {self.name!r}.",
                    f"It has: {', '.join(sorted(known))}." if known else "It has no backends.",
                    "The backend may have been retired; everything it measured is kept.",
                ) from missing
            time.sleep(_PAUSE_S)
        raise LiveError(
            f"IBM lists the backend {self.name!r} but does not return its data.", "Try again later."
        ) from missing

    def _make_safe(self, service: Any) -> None:
        make_safe(service, self._count)

    def _count(self, submissions: int) -> None:
        self.submissions += submissions

    def _patient(
        self, call: Callable[[], T], about: str = "the account", patient: bool = True
    ) -> T:
        """The result of `call`, retried while its errors are transient, if `patient`."""
        from ibm_cloud_sdk_core import ApiException
        from qiskit.exceptions import QiskitError
        from requests import RequestException
        from tenacity import (
            RetryCallState,
            Retrying,
            retry_if_exception,
            stop_after_delay,
            wait_random_exponential,
        )

        usual_s, patience_s = wait_random_exponential(0.2, max=20), self._patience_s * patient
        too_late = stop_after_delay(patience_s)

        def asked_s(state: RetryCallState) -> float:
            error = None if state.outcome is None else state.outcome.exception()
            return retry_after_s(error) or 0.0

        def say(state: RetryCallState) -> None:
            what = "IBM's service is busy" if asked_s(state) else "IBM's service does not answer"
            self._say(f"{what}; asking again in {duration(state.upcoming_sleep)}")

        retrying = Retrying(
            retry=retry_if_exception(transient),
            stop=lambda state: too_late(state) or asked_s(state) > patience_s,
            wait=lambda state: max(usual_s(state), asked_s(state)),
            before_sleep=say,
            reraise=True,
        )
        try:
            with DetachedErrors(), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the client's warnings address its developers
                return retrying(call)
        except QcompileError:
            raise
        except (QiskitError, ApiException, RequestException, OSError) as error:
            raise explain_error(error) from error
        except Exception as error:  # unexpected answers break the client in many ways
            raise UnreadableAnswerError(about) from error


def _check_extra() -> None:
    for package in ("qiskit_ibm_runtime", "tenacity"):
        if find_spec(package) is None:
            raise MissingExtraError("A run on real hardware", "ibm")
