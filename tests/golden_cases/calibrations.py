"""Calibration files that are refused, and calibrations that do not fit what they are used for."""

from __future__ import annotations

from typing import Any

from .case import Command
from .inputs import calibration, device, hours_ago, policy, with_qubit, write

GOOD = calibration()
ROWS = len(GOOD["response_counts"]["ones"])


def file(**changes: Any) -> dict[str, Any]:
    """A calibration of long ago."""
    return calibration(**{"created": "2026-01-01T00:00:00Z"} | changes)


def part(name: str, **changes: Any) -> dict[str, Any]:
    """That calibration with other values in one of its parts."""
    return file(**{name: GOOD[name] | changes})


def half(name: str, rows: int, **changes: Any) -> dict[str, Any]:
    """That calibration with rows of 0.5 for the counts of a part."""
    return part(name, **{"ones": [[0.5] * 5] * rows} | changes)


CALIBRATIONS: dict[str, Any] = {
    "format-9": file(format="qcompile-calibration-9"),
    "no-device": file(device=None),
    "no-parts": file(readout=None, readout_counts=None, response=None, response_counts=None),
    "kind-other": file(kind="guess"),
    "created-without-zone": file(created="2026-01-01T00:00:00"),
    "created-words": file(created="soon"),
    "qubits-none": file(qubits=[]),
    "qubits-twice": file(qubits=[0, 1, 2, 3, 3]),
    "qubits-beyond": file(qubits=[0, 1, 2, 3, 7]),
    "qubits-fewer": file(qubits=[0, 1, 2, 3]),
    "backend-other": file(backend="ibm_lima"),
    "unknown-key": file(extra=1),
    "readout-short": part("readout", p10=[0.1]),
    "readout-useless": part("readout", p10=[0.5] * 5, p01=[0.5] * 5),
    "readout-unsure": part("readout", p10_error=[0.5] * 5),
    "readout-above-1": part("readout", p10=[1.5] * 5),
    "response-leaves": part("response", curves=[[0.5, 0.9, 0.0]] * 5),
    "response-covariance": part("response", covariance=[[[1, 2, 0], [0, 1, 0], [0, 0, 1]]] * 5),
    "response-flat": part("response", curves=[[0.0, 0.01, 0.0]] * 5),
    "counts-uneven": half("readout_counts", 2, prepared=[[0, 1]]),
    "counts-one-state": half("readout_counts", 2, prepared=[[0] * 5] * 2),
    "counts-many": half("response_counts", ROWS, ones=[[1.5] * 5] * ROWS),
    "counts-rows": half("response_counts", 1),
    "counts-angles": half("response_counts", ROWS, angles_rad=[[0.5]] * ROWS),
}


def files() -> None:
    write({f"{name}.json": contents for name, contents in CALIBRATIONS.items()})
    write(
        {
            "tiny.json": policy(),
            "cut.json": '{"format": "qcompile-calibration-1", "backend": ',
            "device.json": device(),
            "lima.json": GOOD,
            "two.json": calibration(of=(0, 1)),
            "readout.json": calibration(parts=("readout",)),
            "response.json": calibration(parts=("response",)),
            "old.json": calibration(created="2020-01-01T00:00:00Z"),
            "later.json": calibration(created=hours_ago(-5.01)),
            "tilted.json": part(
                "response", curves=[[0.0, 0.5, 0.5]] * 5, covariance=[[[0.0] * 3] * 3] * 5
            ),
            "dead.json": device(
                name="dead", qubits=[with_qubit(0, p10=0.5, p01=0.5)["qubits"][0]] * 5
            ),
        }
    )


RUN = "run tiny.json --episodes 1 --max-steps 1 --shots exact"

CASES = (
    *(f"show tiny.json --backend {name}.json" for name in CALIBRATIONS),
    "show tiny.json --backend cut.json",
    "show tiny.json --backend readout.json",
    "calibrate --from device.json",
    "calibrate --from tiny.json",
    "calibrate --from nosuch.json",
    "calibrate --from cut.json",
    "calibrate --from two.json --qubits 1,3",
    f"{RUN} --backend fake_lima --calibration nosuch.json",
    f"{RUN} --backend fake_lima --calibration cut.json",
    f"{RUN} --backend fake_lima --calibration device.json",
    f"{RUN} --backend ibm_lima --calibration lima.json",
    f"{RUN} --backend fake_lima --calibration two.json",
    f"{RUN} --backend fake_lima --calibration two.json --mitigation response",
    f"{RUN} --backend fake_lima --calibration readout.json --mitigation response",
    f"{RUN} --backend fake_lima --calibration readout.json --predistort",
    f"{RUN} --backend fake_lima --calibration response.json --mitigation readout",
    f"{RUN} --backend fake_lima --calibration tilted.json --mitigation response",
    f"{RUN} --backend fake_lima --calibration lima.json --mitigation response --level 1",
    f"{RUN} --backend fake_lima --predistort --level 1",
    f"{RUN} --backend lima.json --level 1",
    f"{RUN} --backend lima.json --calibration two.json",
    f"{RUN} --backend dead.json",
    Command(f"{RUN} --backend fake_lima --calibration old.json --greedy"),
    Command(f"{RUN} --backend fake_lima --calibration later.json --greedy"),
)
