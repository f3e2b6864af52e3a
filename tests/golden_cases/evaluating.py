"""`qcompile evaluate`: wrong usage, and grids that cannot be played."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from qcompile.errors import CalibrationError
from qcompile.sweep.complete import CellFailure
from qcompile.sweep.evaluation.cell import run_cell

from .case import Command
from .inputs import calibration, device, policy, write

FEW = "--shots 16 --episodes 1 --workers 1 --out e"


def failing(patch: pytest.MonkeyPatch) -> None:
    """A cell with mitigation cannot be played."""

    def run(cell: Any) -> Any:
        if cell.mitigation == "none":
            return run_cell(cell)
        error = CalibrationError("Qubit 3 cannot be calibrated.", "Leave it out.")
        return CellFailure(cell.name, str(error))

    patch.setattr("qcompile.sweep.evaluation.run.run_cell", run)


def interrupted(patch: pytest.MonkeyPatch) -> None:
    def run_all(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    patch.setattr("qcompile.sweep.complete.run_all", run_all)


def losing(patch: pytest.MonkeyPatch) -> None:
    def run_all(*_: Any, on_loss: Any, **__: Any) -> None:
        on_loss("Workers stopped (killed); running 3 cells again.")
        raise KeyboardInterrupt

    patch.setattr("qcompile.sweep.complete.run_all", run_all)


def files() -> None:
    write(
        {
            "tiny.json": policy(),
            "wrong.json": policy(environment="Acrobot-v1"),
            "other/tiny.json": policy(bias=[1.0, 0.0]),
            "file": "",
            "lima.json": calibration(),
            "two.json": calibration(of=(0, 1)),
            "readout.json": calibration(parts=("readout",)),
            "old.json": calibration(created="2020-01-01T00:00:00Z"),
            "fake_lima.json": device(name="fake_lima", notes=["another one"]),
        }
    )
    Path("taken").mkdir()
    write({"taken/cells": ""})


CASES = (
    "evaluate cartpol",
    "evaluate tiny.json --backend ibm_lma",
    "evaluate tiny.json --backend qiskit:FakeLimaV3",
    "evaluate wrong.json",
    "evaluate tiny.json --out file/e",
    "evaluate tiny.json --out taken",
    "evaluate --out file",
    "evaluate --mitigation none,magic",
    "evaluate --episodes 0",
    "evaluate --shots 1024,many",
    "evaluate --shots 0",
    "evaluate --shots 8,,16",
    "evaluate --backend ideal,",
    "evaluate --level 0,3",
    "evaluate --workers 0",
    "evaluate --seed -1",
    "evaluate --calibration .",
    "evaluate --paper --shots 8",
    "evaluate --paper --page devices.txt",
    "evaluate --paper --out file/e",
    "evaluate --paper --page file/p.md",
    "evaluate --page devices.md",
    "evaluate tiny.json --backend ideal --mitigation readout",
    "evaluate tiny.json --backend lima.json --level 1",
    "evaluate tiny.json --backend fake_lima --mitigation response --level 0,1",
    "evaluate tiny.json --backend qiskit:FakeLimaV2 --shots exact --mitigation none",
    "evaluate tiny.json --backend fake_lima,fake_lima.json",
    "evaluate tiny.json --backend readout.json",
    "evaluate tiny.json --backend ibm_lima --calibration lima.json",
    "evaluate tiny.json --backend fake_lima --mitigation none --calibration lima.json",
    "evaluate tiny.json --backend fake_lima --calibration lima.json,two.json",
    "evaluate tiny.json --backend fake_lima --mitigation response --calibration readout.json",
    "evaluate tiny.json --backend fake_lima --calibration two.json",
    "evaluate tiny.json --backend fake_lima --calibration tiny.json",
    "evaluate tiny.json --backend fake_lima --calibration nosuch.json",
    Command(
        f"evaluate tiny.json --backend fake_lima {FEW}", "one cell fails", failing, masked=True
    ),
    Command(f"evaluate tiny.json --backend ideal,ibm_lima {FEW}2", "Ctrl-C", interrupted),
    Command(f"evaluate tiny.json --backend fake_lima {FEW}3", "lost workers, then Ctrl-C", losing),
    Command(
        f"evaluate tiny.json --backend fake_lima --calibration old.json {FEW}4",
        "an old calibration, then Ctrl-C",
        interrupted,
    ),
)
