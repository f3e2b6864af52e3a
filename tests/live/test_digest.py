"""The digest of a job: journals of version 0.1.0 that are half done find their jobs by it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from qcompile.device import Device, Qubit
from qcompile.ir import Circuit, Program
from qcompile.live.executor import IBMExecutor
from qcompile.live.request import Request
from qcompile.passes import compile

TEXTS = ("h ry(x0) rz(x0) ry(theta0)", "", "ry(0.3) rz(x1) ry(x0-x1)", "x", "rz(x1)")
X, THETA = np.array([[0.3, -1.2], [2.0, 0.7], [0.0, -0.0]]), np.array([0.4])


class Asked:
    """Jobs that note what is asked for and answer that nothing was counted."""

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self.journal: Any = SimpleNamespace(path="nowhere")

    def ones(self, request: Request) -> np.ndarray:
        self.requests.append(request)
        return np.zeros((len(request.angles), len(request.circuits)), dtype=np.int64)


@pytest.mark.parametrize(
    ("basis", "level", "digest"),
    [
        ("rz sx x", 0, "4f46e14468fbf3d3d16efe493982ab3e9bdcfd99c9812165ed49a1a31c21e7d9"),
        ("rz sx x", 1, "8bc7244afca434af045394ce0e60542d01fbbbc5bb8a966cf19f39f93656bab7"),
        ("rz sx x", 2, "37136e2d9fd7958ef0792ef47b28029deae1f2aa2cfdcfd04349b4ef96ff5da8"),
        ("rz rx", 0, "3d1474f87bec870dbb7ff54d70f17cdd8f3c0a953bdb4e9bd642642424b82c55"),
        ("rz rx", 1, "8aba22839419afea79e958b721768cc15bc5934fb0a13730faecde969cf1ca78"),
        ("rz rx", 2, "523457ec2de8d913a1431a056e44b4c38eb428818939ae66343c8447db6001b6"),
    ],
)
def test_a_job_has_the_digest_of_version_0_1_0(basis: str, level: int, digest: str) -> None:
    """The digests were made by the code of that version: circuits of 0 to 5 slots, two rounds."""
    qubits = tuple(Qubit(t1_us=100, t2_us=80, p10=0.01 * q, p01=0.02) for q in range(3))
    device = Device(
        name="three", source="by hand", basis_gates=tuple(basis.split()), qubits=qubits
    )  # fmt: skip
    executable = compile(Program.of(map(Circuit.parse, TEXTS), 2, 1), device, level)
    assert executable.round_count == 2
    jobs = Asked()
    executor = IBMExecutor(device, jobs)  # type: ignore[arg-type]
    assert executor.run(executable, X, THETA, 100).shape == (3, 5)
    (request,) = jobs.requests
    assert request.digest == digest


def test_another_job_has_another_digest() -> None:
    device = Device(
        name="one",
        source="by hand",
        basis_gates=("rz", "sx", "x"),
        qubits=(Qubit(t1_us=1, t2_us=1, p10=0, p01=0),) * 2,
    )
    jobs = Asked()
    executor = IBMExecutor(device, jobs)  # type: ignore[arg-type]
    for text in ("ry(x0)", "ry(x0) x"):
        executable = compile(Program.of([Circuit.parse(text)] * 3, 1), device)
        for x in (0.3, 0.3 + 1e-12, 0.4):
            for shots in (10, 11):
                executor.run(executable, np.array([[x]]), np.zeros(0), shots)
    assert len(jobs.requests) == 12
    assert len({request.digest for request in jobs.requests}) == 8
