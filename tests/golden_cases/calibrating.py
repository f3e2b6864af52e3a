"""`qcompile calibrate` and `validate`: wrong usage, contradictions, and what cannot be measured."""

from __future__ import annotations

from typing import Any

from .case import Command
from .inputs import calibration, ctrl_c_in, device, hours_ago, policy, with_qubit, write

CURVED: dict[str, Any] = calibration(shots=8192)
SCALED = {"curves": [[b, 0.8 * c, s] for b, c, s in CURVED["response"]["curves"]]}


def files() -> None:
    counted = {"shots": 8192}
    write(
        {
            "tiny.json": policy(),
            "flat.json": policy(circuits=[[["h"]]] * 4, theta=[]),
            "cut.json": '{"format": "qcompile-calibration-1", "backend": ',
            "device.json": device(),
            "there.json": "paid for",
            "lima.json": calibration(**counted),
            "exact.json": calibration(),
            "two.json": calibration(of=(0, 1), parts=("readout",), **counted),
            "readout.json": calibration(parts=("readout",)),
            "old.json": calibration(**counted, created=hours_ago(30.01)),
            "later.json": calibration(**counted, created=hours_ago(-3.01)),
            "moved.json": with_qubit(3, p01=0.15) | {"name": "fake_lima"},
            "scaled.json": calibration(**counted, response=CURVED["response"] | SCALED),
            "unfitted.json": calibration(
                **counted, readout=None, unfitted=["Too few shots: the readout of qubit 0."]
            ),
            "misfit.json": calibration(
                **counted, response=CURVED["response"] | {"chi_square": [500.0] * 5}
            ),
        }
    )


LIMA = "calibrate --backend fake_lima"
VALIDATE = "validate lima.json --policy tiny.json"

CASES = (
    "calibrate",
    "calibrate --backend ideal",
    "calibrate --backend nosuch",
    "calibrate --backend ''",
    "calibrate --backend readout.json",
    f"{LIMA} --qubits 0 --policy tiny.json",
    f"{LIMA} --qubits 0,x",
    f"{LIMA} --qubits -1",
    f"{LIMA} --qubits 0,7",
    f"{LIMA} --policy nosuch",
    f"{LIMA} --parts all",
    f"{LIMA} --shots 0",
    f"{LIMA} --plot a.jpg",
    f"{LIMA} --check lima.json --shots exact",
    f"{LIMA} --check lima.json --force",
    f"{LIMA} --check cut.json",
    f"{LIMA} --check nosuch.json",
    f"{LIMA} --check a.png --plot a.png",
    f"{LIMA} --max-age-hours 2",
    f"{LIMA} --max-age-hours 0 --check lima.json",
    f"{LIMA} --max-age-hours nan --check lima.json",
    f"{LIMA} --out a.png --plot x/../a.png",
    f"{LIMA} --out there.json",
    f"{LIMA} --out there.json/a.json",
    f"{LIMA} --out a.json --plot there.json/a.png",
    "calibrate --backend ibm_lima --check lima.json",
    f"{LIMA} --check two.json --qubits 0,4",
    f"{LIMA} --check two.json --parts response",
    f"{LIMA} --check exact.json",
    f"{LIMA} --check unfitted.json",
    Command(f"{LIMA} --check old.json --seed 2", masked=True),
    Command(f"{LIMA} --check later.json --seed 2", masked=True),
    Command("calibrate --backend moved.json --check lima.json --seed 2", masked=True),
    Command(f"{LIMA} --shots 2 --seed 1", masked=True),
    Command(f"{LIMA} --out a.json", "Ctrl-C", ctrl_c_in("qcompile.mitigation.measure.fit_readout")),
    Command(
        f"{LIMA} --out a.json --plot a.png --seed 1",
        "Ctrl-C while the picture is drawn",
        ctrl_c_in("qcompile.report.calibration.draw_calibration"),
        masked=True,
    ),
    *(
        f"calibrate --from lima.json {option}"
        for option in (
            "--backend fake_lima",
            "--shots 8192",
            "--seed 1",
            "--check lima.json",
            "--parts readout",
            "--policy tiny.json",
            "--max-age-hours 3",
            "--live --max-qpu-seconds 9",
            "--plot a.jpg",
            "--out there.json",
            "--out a.png --plot a.png",
        )
    ),
    "calibrate --from a.png --plot a.png",
    "validate",
    "validate nowhere.json",
    "validate device.json",
    "validate readout.json --policy tiny.json",
    "validate lima.json --policy nosuch",
    "validate lima.json --policy flat.json",
    f"{VALIDATE} --backend fake_belem",
    f"{VALIDATE} --backend nosuch",
    f"{VALIDATE} --shots exact",
    f"{VALIDATE} --observations 0",
    f"{VALIDATE} --power 1",
    f"{VALIDATE} --power nan",
    f"{VALIDATE} --effect 0",
    f"{VALIDATE} --effect nan",
    f"{VALIDATE} --power 0.5 --observations 3 --shots 500",
    Command(f"{VALIDATE} --effect 0.01", masked=True),
    Command("validate scaled.json --policy tiny.json --observations 3 --shots 5000", masked=True),
    Command("validate misfit.json --policy tiny.json --observations 3 --shots 5000", masked=True),
)
