"""IBM's service, reached through qiskit-ibm-runtime: account, backend, and its errors in words."""

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
"""Tokens may expire one after the other; one that never holds is told."""
_FREE = ["open"]


class Connection:
    """The account `account` of IBM's own tools (their default if None), and one of its backends.

    It is opened when it is first used. Without `instance`, and where the account names none, only
    instances of the free Open Plan are considered. A request that submits a job is never repeated
    by the client: it might submit twice. `submissions` counts those that left this machine. An
    answer is waited for `patience_s`, by default QCOMPILE_PATIENCE_SECONDS; `say` is told so. A
    service that is busy is not asked again before the time that it names in Retry-After. An
    IBMBackend that is `given` is used, and its service, whose client repeats no submission from
    then on.
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
            LiveError: no account, or one that is refused, or no answer.
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
        """The backend's qubits with their calibration of now.

        Raises:
            DeviceError: its calibration makes no device.
            LiveError: as for `backend`.
        """
        backend = self.backend
        return self.ask(
            lambda service: device_from_backend(backend, self.name),
            about=f"the backend {self.name}",
        )

    def target(self) -> Any:
        """What the backend can run, as Qiskit's Target.

        Raises:
            LiveError: as for `backend`.
        """
        backend = self.backend
        return self.ask(lambda service: backend.target, about=f"the backend {self.name}")

    def ask(
        self, question: Callable[[Any], T], *, about: str = "the account", patient: bool = True
    ) -> T:
        """The answer of `question`, called with the service, which only reads.

        It is asked again while the service is busy or cannot be reached, if `patient`, and after a
        new login, a few times at most, where a token has expired. `about` says what it is about.

        Raises:
            LiveError: no answer for long, or a refusal, in words.
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
        """Have the backend found anew.

        Raises:
            LiveError: the account has it no more.
        """
        self._backend = None
        self.backend  # noqa: B018

    def log_in_again(self) -> None:
        """Have a new token.

        Raises:
            LiveError: IBM gives none.
        """
        service = self.service
        self._patient(lambda: log_in(service))

    @property
    def crn(self) -> str:
        """The instance that the backend is used by."""
        return str(self.backend._instance)

    def left_on_plan_s(self) -> float | None:
        """QPU seconds that the plan has left, as far as IBM says."""
        self.refresh_backend()  # the client speaks for the instance it last used

        def ask(service: Any) -> float | None:
            remaining_s = service.usage().get("usage_remaining_seconds")
            return None if remaining_s is None or math.isnan(remaining_s) else float(remaining_s)

        return self.ask(ask, about="what the plan has left")

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
                "This version of qiskit-ibm-runtime is not known: it might submit a job twice.",
                "Install that of constraints.txt: pip install -c constraints.txt 'qcompile[ibm]'",
            ) from error
        return service

    def _find(self, service: Any) -> Any:
        from qiskit.providers.exceptions import QiskitBackendNotFoundError

        if self._given is not None:
            given, self._given = self._given, None  # once: looked for again, it is found by name
            return given
        for _ in range(_LOOKS):
            try:
                backend = service.backend(self.name)
            except QiskitBackendNotFoundError as error:
                missing = error
            else:
                self._make_safe(service)  # the client may have made another session for it
                return backend
            # The client says so as well where the list, or the backend's own data, did not arrive.
            known = {
                data["name"] for client in clients(service) for data in client.list_backends(True)
            }
            if self.name not in known:
                raise LiveError(
                    f"The account has no backend {self.name!r}.",
                    f"It has: {', '.join(sorted(known))}." if known else "It has none.",
                    "A backend that was there may be retired; what it measured is kept.",
                ) from missing
            time.sleep(_PAUSE_S)
        raise LiveError(
            f"IBM lists the backend {self.name!r}, but does not give its data.", "Try later."
        ) from missing

    def _make_safe(self, service: Any) -> None:
        make_safe(service, self._count)

    def _count(self, submissions: int) -> None:
        self.submissions += submissions

    def _patient(
        self, call: Callable[[], T], about: str = "the account", patient: bool = True
    ) -> T:
        """What `call` gives, called again while its errors are transient, if `patient`."""
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
                warnings.simplefilter("ignore")  # the client's words go to people who program it
                return retrying(call)
        except QcompileError:
            raise
        except (QiskitError, ApiException, RequestException, OSError) as error:
            raise explain_error(error) from error
        except Exception as error:  # of the client: what another shape breaks depends on the shape
            raise UnreadableAnswerError(about) from error


def _check_extra() -> None:
    for package in ("qiskit_ibm_runtime", "tenacity"):
        if find_spec(package) is None:
            raise MissingExtraError("A run on real hardware", "ibm")
