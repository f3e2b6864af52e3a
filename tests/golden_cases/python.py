"""What Python is told: expressions that are refused, among the public names and a few others."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import qcompile
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import make_environments
from qcompile.deploy.play import play
from qcompile.execution import PrimitiveExecutor
from qcompile.ir import Gate, LateAngle
from qcompile.ir.angle import check_symbol
from qcompile.live.connection import Connection
from qcompile.live.journal import Journal
from qcompile.mitigation import measure_drift
from qcompile.mitigation.fits import fit_readout, fit_response
from qcompile.mitigation.predistort import predistorted
from qcompile.policy.layouts import single
from qcompile.qasm import Layout, Register
from qcompile.qasm import write as write_qasm
from qcompile.rl.presets import settings_for
from qcompile.rl.settings import Settings
from qcompile.sweep.engine import run_all
from qcompile.sweep.study import StudyRequest
from qcompile.sweep.study.write_up import write_up

from .case import Expression
from .inputs import calibration, policy, write

MEASURED = ("counted", "fewer", "answering", "turned", "belem", "readout")


@functools.cache
def names() -> dict[str, Any]:
    """The public names, and what the expressions below are made of."""
    lima = qcompile.load_device("fake_lima")
    program = qcompile.Program.of([qcompile.Circuit.parse("h ry(x0) rz(x0) ry(theta0)")], 1, 1)
    fused = qcompile.compile(program, lima)
    measured = qcompile.load_calibration(Path("lima.json"))
    predistorted_once = predistorted(fused, measured)
    small = qcompile.load_policy("tiny.json")
    known = {name: getattr(qcompile, name) for name in qcompile.__all__}
    return known | {
        "np": np,
        "torch": torch,
        "Path": Path,
        "Gate": Gate,
        "LateAngle": LateAngle,
        "check_symbol": check_symbol,
        "single": single,
        "predistorted": predistorted,
        "Layout": Layout,
        "Register": Register,
        "write": write_qasm,
        "Settings": Settings,
        "make_environments": make_environments,
        "settings_for": settings_for,
        "Deployment": Deployment,
        "PrimitiveExecutor": PrimitiveExecutor,
        "replace": replace,
        "play": play,
        "Journal": Journal,
        "Connection": Connection,
        "fit_readout": fit_readout,
        "fit_response": fit_response,
        "run_all": run_all,
        "measure_drift": measure_drift,
        "write_up": write_up,
        "StudyRequest": StudyRequest,
        "lima": lima,
        "program": program,
        "executable": fused,
        "predistorted_once": predistorted_once,
        "policy": small,
        "calibration": measured,
        "executor": qcompile.OfflineExecutor(lima),
        **{name: qcompile.load_calibration(Path(f"{name}.json")) for name in MEASURED},
        "bound": program.substitute({"x0": 0.5, "theta0": 1.0}),
        "x": np.zeros((2, 1)),
        "theta": np.zeros(1),
        "ones": np.zeros((2, 1)),
    }


def files() -> None:
    counted: dict[str, Any] = {"shots": 8192, "created": "2026-01-01T00:00:00Z"}
    turned = calibration(**counted)
    turned["response_counts"]["angles_rad"][0][0] += 0.1
    write(
        {
            "turned.json": turned,
            "answering.json": calibration(of=(0, 1), **counted, parts=("response",)),
            "tiny.json": policy(),
            "lima.json": calibration(),
            "readout.json": calibration(parts=("readout",)),
            "counted.json": calibration(**counted),
            "fewer.json": calibration(of=(0, 1), **counted, parts=("readout",)),
            "belem.json": calibration(on="fake_belem", **counted),
            "hollow.json": "{}",
        }
    )


CASES = tuple(
    Expression(code, names)
    for code in (
        'load_policy("nosuch")',
        'load_device("ibm_lime")',
        'load_calibration(Path("hollow.json"))',
        'load_calibration("fake_lima")',
        'validate("fake_lima")',
        'OfflineExecutor("fake_lima")',
        'run("tiny.json", "fake_lima", shots="many")',
        'run("tiny.json", "ibm_fez", live=True)',
        'calibrate("ibm_fez", live=True)',
        'validate("lima.json", live=True)',
        'evaluate("tiny.json", "fake_lima", shots=[64, "many"])',
        'plan("tiny.json", "fake_lima", shots=None)',
        'save_policy(policy, "tiny.txt")',
        'Angle.of("x0*x1")',
        "Angle.of([1])",
        "Angle.of(10**400)",
        'Angle.of(float("nan"))',
        'Angle.of("1e308*x0").substitute({"x0": 1e308})',
        'Angle.symbol("1x")',
        'check_symbol("pi")',
        'Gate.of("rxx")',
        'Gate.of("nothing at all")',
        'Gate("h", Angle(1.0))',
        'Gate("ry")',
        'Circuit.parse("h ry(x0")',
        'Circuit.parse("h (")',
        'Circuit.of(["h"])',
        "Circuit.of([[3]])",
        'Program((), ("x0", "x0"))',
        'Program.of([Circuit.parse("ry(x1)")], 1)',
        'Program.parse("0: h\\n2: x")',
        'Program.parse("nothing")',
        'executable.native.substitute({"x0": 1.0})',
        "executable.native.side_by_side(2)",
        "Simulator(executable.native, torch)",
        "compile(program, lima, level=3)",
        "compile(program, lima, importance=[1.0, 2.0])",
        "compile(program, lima, importance=[-1.0])",
        "executable.bind(np.zeros((2, 3)), theta)",
        "executable.bind(x, np.zeros(2))",
        "executable.bind(np.full((2, 1), np.inf), theta)",
        "executor.run(executable, x, theta, 0)",
        "executor.run(executable, x, theta, 10**8)",
        'OfflineExecutor(load_device("ibm_lima")).run(executable, x, theta, 10)',
        "expectation_from_ones(np.array([3, 11]), 10)",
        "expectation_from_ones(np.array([3]), 0)",
        "TwinExecutor(readout)",
        "TwinExecutor(calibration).run(compile(program, lima, level=1), x, theta, 10)",
        "calibrate(executor, np.array([], dtype=int), 100)",
        "calibrate(executor, np.array([0, 9]), 100)",
        "measure_drift(counted, belem)",
        "measure_drift(calibration, counted)",
        "measure_drift(fewer, counted)",
        "measure_drift(counted, turned)",
        "measure_drift(fewer, answering)",
        "predistorted(predistorted_once, calibration)",
        "predistorted(executable, readout)",
        "fit_readout(np.zeros((2, 1), int), ones, 10, np.array([0]))",
        "fit_response(np.zeros(2), ones, 10, np.array([0]))",
        "PrimitiveExecutor(executor.device, sampler=executor).expectation(executable, x, theta)",
        "PrimitiveExecutor(executor.device)",
        "replace(policy, bias=np.zeros(3))",
        "replace(policy, bias=np.array([0.0, np.nan]))",
        "replace(policy, encoder=replace(policy.encoder, scale=np.full(4, 1e30)))",
        'save_policy(replace(policy, name="a\\nb"), "p.json")',
        "policy.encode(np.zeros((1, 3)))",
        "policy.encode(np.zeros(4))",
        "single(2, 1)",
        'write(program, version="4")',
        'write(program, version="2")',
        'write(bound, version="2", qubits=[3])',
        "write(executable.native)",
        "write(program, layout=Layout.default(2))",
        'write(Program((), ("gate",)))',
        'write(Program((), ("q",)))',
        "Layout.default(2).on([1, 1])",
        "Layout.default(2).on([1])",
        "Layout.default(1).on([-1])",
        'Layout((Register("q", 1),) * 2, (), (), ())',
        'Layout((), (), (("q", 0),), (None,))',
        'Layout((), (Register("c", 1),), (0,), (("c", 1),))',
        'Layout((), (Register("c", 1),), (0,), (("c", 0),), ((3, ("c", 0)),))',
        'Layout((Register("q", 1),), (Register("c", 1),), (("q", 0),), (None,), ((3, ("c", 0)),))',
        'Deployment(policy, "fake_lima", mitigation="magic")',
        'Deployment(policy, "fake_lima", mitigation="readout", predistort=True)',
        'Deployment(policy, "fake_lima", mitigation="readout", calibration=belem)',
        'Deployment(policy, "fake_lima", shots=0)',
        'Deployment(policy, "fake_lima", copies=0)',
        'play(Deployment(policy, "ideal"), 0)',
        'make_environments("CartPool-v1", 1)',
        'settings_for("best", "CartPole-v1")',
        'settings_for("paper", "CartPole-v1", "gnn")',
        'settings_for("paper", "CartPole-v1", "svqc", "ring")',
        "Settings(steps=1).changed(actor_rl=0.1)",
        "Settings(steps=1).changed(gamma=2, clip=-1)",
        "Settings().check()",
        "Settings(environments=4, steps=1).check()",
        'run_all([policy], print, print, engine="slurm")',
        'write_up(StudyRequest(out="s", page="p.md"), [])',
        'Journal(Path("nowhere"))',
        'Journal.create(Path("runs"), "run", "cart", {}, {}, 0.0)',
        'Connection("")',
    )
)
