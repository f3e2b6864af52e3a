"""Device files that are refused, backends that no name leads to, and `qcompile backends`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.snapshot import find_backend

from .case import Change, Command
from .inputs import calibration, device, with_qubit, without, write

DEVICES: dict[str, Any] = {
    "no-name": device(name=None),
    "no-source-no-gates": device(source=None, basis_gates=None),
    "name-with-space": device(name="a b"),
    "name-ideal": device(name="ideal"),
    "format-9": device(format="qcompile-device-9"),
    "unknown-key": device(colour="red"),
    "no-qubits": device(qubits=[]),
    "gates-u": device(basis_gates=["u1", "u2"]),
    "gates-text": device(basis_gates="rz sx x"),
    "left-out-9": device(left_out=[9]),
    "left-out-all": device(left_out=[0, 1, 2, 3, 4]),
    "left-out-text": device(left_out=["1"]),
    "source-two-lines": device(source="two\nlines"),
    "p10-large": with_qubit(p10=1.2),
    "p10-text": with_qubit(p10="0.1"),
    "p01-negative": with_qubit(p01=-0.1),
    "t1-none": with_qubit(t1_us=None),
    "t2-zero": with_qubit(t2_us=0),
    "t3-unknown": with_qubit(t3_us=1.0),
    "readout-negative": with_qubit(readout_ns=-1),
    "gate-without-length": with_qubit(gates={"sx": {"error": 0.1}}),
    "gate-error-2": with_qubit(gates={"sx": {"error": 2, "length_ns": 1}}),
    "gate-name": with_qubit(gates={"[/x]": {"error": 0.1, "length_ns": 1}}),
    "ideal-without-qubits": device(name="ideal", qubits=[]),
}
TEXTS: dict[str, Any] = {
    "empty.json": "",
    "cut.json": '{"name": ',
    "list.json": "[1, 2]",
    "infinite.json": '{"format": "qcompile-device-1", "qubits": [{"t1_us": Infinity}]}',
}


def of_lima(change: Callable[[Any], object]) -> Change:
    """Qiskit's FakeLimaV2 has other properties."""

    def patched(patch: pytest.MonkeyPatch) -> None:
        properties = find_backend("FakeLimaV2").properties()
        change(properties)
        name = "qiskit_ibm_runtime.fake_provider.FakeLimaV2.properties"
        patch.setattr(name, lambda backend: properties)

    return patched


def without_t1(properties: Any) -> None:
    properties.qubits = [[v for v in qubit if v.name != "T1"] for qubit in properties.qubits]


def in_fortnights(properties: Any) -> None:
    for value in properties.qubits[0]:
        value.unit = "fortnight"


def doubtful(properties: Any) -> None:
    properties.qubits[1] = [v for v in properties.qubits[1] if v.name != "T2"]
    for value in properties.qubits[2]:
        if value.name == "prob_meas1_prep0":
            value.value = 1.5


def files() -> None:
    write({f"{name}.json": contents for name, contents in DEVICES.items()})
    write(TEXTS)
    write({"measured.json": calibration(), "readout.json": calibration(parts=("readout",))})
    Path("folder.json").mkdir()
    write({"there.json": device()})


CASES = (
    *(f"backends show {name}.json" for name in DEVICES),
    *(f"backends show {name}" for name in TEXTS),
    "backends show folder.json",
    "backends show ibm_lime",
    "backends show nothing_like_it",
    "backends show ''",
    "backends show qiskit:FakeLimma",
    "train CartPole-v1 --backend measured.json --out p.pt",
    "show cartpole --backend readout.json",
    "backends show",
    "backends nosuch",
    "backends --nosuch",
    "backends --json show ibm_lima",
    "backends add",
    "backends add FakeLimma",
    "backends add fake_limma",
    "backends add FakeLimaV2 --name ideal",
    "backends add FakeLimaV2 --out there.json",
    "backends add FakeLimaV2 --name 'a b'",
    "backends add FakeLimaV2 --out there.json/b.json",
    "backends add FakeLimaV2 --out folder.json",
    "backends add FakeEssexV2",
    Command("backends add FakeLimaV2", "no qubit has a T1", of_lima(without_t1)),
    Command("backends add FakeLimaV2", "times are in fortnights", of_lima(in_fortnights)),
    Command("backends add FakeLimaV2 --out a.json", "two qubits lack a value", of_lima(doubtful)),
    Command("backends add FakeLimaV2", "without qiskit-ibm-runtime", without("qiskit_ibm_runtime")),
    Command(
        "backends show qiskit:FakeLimaV2",
        "without qiskit-ibm-runtime",
        without("qiskit_ibm_runtime"),
    ),
    Command(
        "backends",
        "with a broken file in hardware/",
        lambda patch: write({"hardware/mine.json": '{"format": "qcompile-device-1"}'}),
    ),
)
