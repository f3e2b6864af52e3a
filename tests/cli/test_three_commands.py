"""The three commands of the design work literally as they are written there."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

Call = Callable[..., Any]

TRAINED = Path(__file__).parents[2] / "trained"


def type_line(qcompile: Call, line: str) -> str:
    """What a command line prints; it must succeed."""
    answer = qcompile(*shlex.split(line)[1:])
    assert answer.code == 0, answer.err
    return str(answer.out)


def test_export(qcompile: Call, empty_folder: Path) -> None:
    shutil.copytree(TRAINED, empty_folder / "trained")
    out = type_line(qcompile, "qcompile export trained/lunarlander.pt")
    assert "lunarlander-job" in out
    job = json.loads(Path("lunarlander-job/job.json").read_text())
    assert job["format"] == "qcompile-job-1"
    written = [index for program in job["programs"] for index in program["circuits"]]
    assert sorted(written) == list(range(24))
    assert all((Path("lunarlander-job") / program["file"]).is_file() for program in job["programs"])


def test_run(qcompile: Call) -> None:
    out = type_line(qcompile, "qcompile run --backend ibm_lima")
    assert "lunarlander" in out
    assert "ibm_lima" in out


def test_evaluate(qcompile: Call) -> None:
    out = type_line(qcompile, "qcompile evaluate lunarlander --backend ibm_lima")
    assert "lunarlander" in out
    assert "ibm_lima" in out
