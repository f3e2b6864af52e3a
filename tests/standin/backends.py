"""The machines of the stand-in: IBM's fakes, their configuration and calibration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from qcompile.device import Device
from qcompile.snapshot import device_from_backend, find_backend

DEFAULT_BACKENDS: Mapping[str, str] = {
    "fake_lima": "FakeLimaV2",
    "fake_toronto": "FakeTorontoV2",
    "fake_sherbrooke": "FakeSherbrooke",
    "fake_fez": "FakeFez",
}
"""5, 27, 127 and 156 qubits."""


@dataclass(frozen=True)
class Machine:
    """One backend: its data at the service, and the noise that its bits are drawn from."""

    name: str
    configuration: dict[str, Any]
    properties: dict[str, Any]
    device: Device

    @property
    def qubits(self) -> int:
        return int(self.configuration["n_qubits"])

    @property
    def basis_gates(self) -> tuple[str, ...]:
        return tuple(self.configuration["basis_gates"])

    def entry(self, queue_length: int) -> dict[str, Any]:
        """The machine's entry in the list of machines."""
        return {
            "name": self.name,
            "status": {"name": "online", "reason": "available"},
            "is_simulator": False,
            "qubits": self.qubits,
            "physical_qubits": self.qubits,
            "queue_length": queue_length,
            "processor_type": self.configuration.get("processor_type"),
        }

    def status(self, queue_length: int) -> dict[str, Any]:
        return {
            "state": True,
            "status": "active",
            "message": "available",
            "length_queue": queue_length,
            "backend_version": self.configuration["backend_version"],
        }


@lru_cache(maxsize=16)
def load_machine(name: str, fake: str) -> Machine:
    """The machine called `name` with the data of one of IBM's fakes.

    Raises:
        DeviceError: there is no such fake.
    """
    backend = find_backend(fake)
    folder = Path(backend.dirname)
    configuration = json.loads((folder / backend.conf_filename).read_text())
    properties = json.loads((folder / backend.props_filename).read_text())
    # The client posts jobs to the name that the configuration holds, not to the one it asked for.
    configuration["backend_name"] = properties["backend_name"] = name
    return Machine(name, configuration, properties, device_from_backend(backend, name))
