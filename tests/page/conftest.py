"""Reports of every kind, made once, of results that are cheap to have."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock
from rings import ring_gates, ring_policy

import qcompile
from qcompile.sweep.evaluation.run import Evaluation
from qcompile.verbs.evaluate import EvaluationResult
from qcompile.verbs.reports import Reported

DOCS = Path(__file__).parents[2] / "docs"

HOSTILE = "<script>alert(1)</script>\"'&amp;$x$"
"""A name that would be markup, end an attribute, or be mathematics."""


def hostile_policy() -> qcompile.Policy:
    """A policy of CartPole with three shapes among four circuits, and that name."""
    x, theta = ["ry", "x0"], ["ry", "theta0"]
    lists = [[["h"], x, theta], [["h"], ["ry", "x1"], theta], [x], [["rz", 0.5], ["rx", "x3"], x]]
    program = qcompile.Program.of(map(qcompile.Circuit.of, lists), inputs=4, parameters=1)
    values = {
        "format": "qcompile-policy-1",
        "name": HOSTILE,
        "environment": "CartPole-v1",
        "encoder": {"function": "arctan", "feature": [0, 1, 2, 3], "scale": [1.0] * 4},
        "circuits": [circuit.to_lists() for circuit in program.circuits],
        "theta": [0.1],
        "weights": [[1.0, 1.0, 2.0, 1.0], [-1.0, -1.0, -2.0, -1.0]],
        "bias": [0.0, 0.0],
    }
    path = Path("hostile.json")
    path.write_text(json.dumps(values))
    policy = qcompile.load_policy(path)
    assert isinstance(policy, qcompile.Policy)
    return policy


def _run() -> Reported:
    return qcompile.run(
        hostile_policy(),
        "ibm_lima",
        episodes=6,
        max_steps=30,
        video="film.mp4",
        progress=False,
    )


def _evaluate() -> Reported:
    """Device tests of the documentation."""
    cells = json.loads((DOCS / "devices" / "results.json").read_text())["results"]
    names = [*dict.fromkeys(cell["policy"] for cell in cells)][:2]
    cells = [cell for cell in cells if cell["policy"] in names]
    return EvaluationResult(Evaluation((), tuple(cells), 0, len(cells), (), ()), ())


def _calibrate() -> Reported:
    from qcompile.verbs.calibrate import calibrate_into
    from qcompile.verbs.calibration_request import CalibrationRequest

    request = CalibrationRequest("ibm_lima", seed=1, progress=False)
    return calibrate_into(request, Path("lima.json"))


def _study() -> Reported:
    """The trainings of one row of the documentation, all there already."""
    cells = Path("study") / "cells"
    cells.mkdir(parents=True)
    for file in (DOCS / "study" / "cells").glob("cartpole-svqc-*seed[01].json"):
        shutil.copy(file, cells)
    rows = sorted({file.name.rpartition("-seed")[0] for file in cells.iterdir()})
    return qcompile.study("paper", rows=rows[:2], seeds=2, out="study", progress=False)


def _plan() -> Reported:
    return qcompile.plan("cartpole", "ibm_toronto", max_steps=15, progress=False)


def _wide() -> Reported:
    """Circuits of several qubits and of one, on a device whose map is cut on a phone."""
    narrow = [[["h"], ["ry", "x1"]], [["ry", "x2"], ["rz", "theta1"]]]
    blocks = [{"qubits": 4, "gates": ring_gates(4)}, *narrow]
    values = ring_policy(circuits=blocks, observables=[[0, 1], [4], [5]], name=HOSTILE)
    values["weights"] = [[1.0, 2.0, 3.0], [-1.0, -2.0, -3.0]]
    Path("wide.json").write_text(json.dumps(values))
    return qcompile.run(
        qcompile.load_policy("wide.json"), "fake_fez", episodes=3, max_steps=9, shots=64,
        progress=False,
    )  # fmt: skip


KINDS: dict[str, Callable[[], Reported]] = {
    "run": _run,
    "evaluate": _evaluate,
    "calibrate": _calibrate,
    "study": _study,
    "plan": _plan,
    "wide": _wide,
}


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The file of a report, by its kind; processes that test side by side make each once."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def make(kind: str) -> Path:
        folder = shared / f"report-{kind}"
        with FileLock(f"{folder}.lock"):
            if not (folder / "report.html").exists():
                folder.mkdir(exist_ok=True)
                with pytest.MonkeyPatch.context() as patched:
                    patched.chdir(folder)
                    KINDS[kind]().report("report.html")
        return folder / "report.html"

    return make
