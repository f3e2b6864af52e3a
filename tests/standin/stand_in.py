"""The stand-in as a whole: a server on loopback that a `with` block starts and stops."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

from werkzeug.serving import WSGIRequestHandler, make_server

from .backends import DEFAULT_BACKENDS, load_machine
from .faults import Faults
from .identity import API_KEY, CRN, Identity
from .jobs import Ledger
from .server import API, Application
from .service import Service
from .settings import Settings

LOOPBACK = "127.0.0.1"


class StandIn:
    """IBM's Quantum REST API on 127.0.0.1, for as long as the `with` block lasts.

    `backends` maps the names of its machines to the fakes of qiskit-ibm-runtime whose data they
    have; `port` 0 takes a free one; the rest are the fields of `Settings`. `settings` and `faults`
    may be changed while it runs, from any thread.

    Raises:
        DeviceError: there is no such fake.
    """

    def __init__(
        self,
        backends: Mapping[str, str] = DEFAULT_BACKENDS,
        *,
        port: int = 0,
        settings: Settings | None = None,
        **changes: Any,
    ):
        self.settings = settings or Settings(**changes)
        self.faults = Faults(self.settings.seed)
        machines = {name: load_machine(name, fake) for name, fake in backends.items()}
        service = Service(machines, self.settings, self.faults)
        self._identity = Identity(self.faults, self.settings)
        self._application = Application(service, self._identity, self.faults)
        self._usual = replace(self.settings)
        self._port = port

    def __enter__(self) -> Self:
        self._server = make_server(
            LOOPBACK, self._port, self._application, threaded=True, request_handler=_Silent
        )
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True
        )
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop the server.

        Raises:
            RuntimeError: the stand-in itself failed in one of its answers.
        """
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()
        if error is None and self._application.defects:
            raise RuntimeError("The stand-in failed.") from self._application.defects[0]

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self._server.server_port}"

    def environment(self) -> dict[str, str]:
        """The variables with which `QiskitRuntimeService()` in any process uses the stand-in."""
        return {
            "QISKIT_IBM_TOKEN": API_KEY,
            "QISKIT_IBM_INSTANCE": CRN,
            "QISKIT_IBM_CHANNEL": "ibm_quantum_platform",
            "QISKIT_IBM_URL": f"{self.url}{API}",
            "IAM_URL": self.url,
            # Without it the client asks IBM's catalogue which instances there are.
            "QISKIT_FUNCTIONS_EXPERIMENTAL": "1",
        }

    def recover(self) -> None:
        """End all faults, and behave as at the beginning."""
        self.faults.clear()
        for name, value in vars(self._usual).items():
            setattr(self.settings, name, value)

    def secrets(self) -> list[str]:
        """The secrets that must not be in any file or on any terminal."""
        return self._identity.secrets()

    def ledger(self) -> Ledger:
        """The jobs, requests and faults up to now; the same as GET /standin/ledger."""
        return self._application.ledger()


class _Silent(WSGIRequestHandler):
    """Writes no line for each request."""

    def log(self, type: str, message: str, *args: Any) -> None:
        pass
