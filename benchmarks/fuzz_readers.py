"""Every reader of files, with intact files of its kind for fuzz.py to damage."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import torch
from mutations import read_all

import qcompile
from qcompile.device import IDEAL, Device, load_device
from qcompile.execution import DeviceBackend, load_backend
from qcompile.jobs.policy_job import read_observations
from qcompile.jobs.program_file import compile_source
from qcompile.live.journal import FILE, Journal
from qcompile.live.perform import costs, task_of
from qcompile.live.play import RunTask
from qcompile.live.records import Register
from qcompile.mitigation import calibrate
from qcompile.noise import usable
from qcompile.passes import compile
from qcompile.policy import (
    Ansatz,
    Convolution,
    Dense,
    Network,
    Policy,
    load_ansatz,
    load_circuits,
    load_policy,
    save_policy,
)
from qcompile.policy.files import policy_values
from qcompile.policy.refusals import UnsupportedPolicyError
from qcompile.qasm import read_file, write
from qcompile.report.live import exported
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.models import make_model
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings
from qcompile.sweep.evaluation import cell as evaluated
from qcompile.sweep.evaluation.grid import Cell
from qcompile.sweep.study import cell as trained
from qcompile.sweep.study.rows import Cell as Training
from qcompile.sweep.study.rows import Row
from qcompile.sweep.study.rows_file import read_rows
from qcompile.sweep.study.studies import BUILT_IN

ROOT = Path(qcompile.__file__).parent.parent


@dataclass(frozen=True)
class Reader:
    """A reader: the kind and name of its files, the function that reads one, and its weight.

    `read` returns None where it refuses without words, as for a cell that is to be played again.
    """

    kind: str
    name: str
    read: Callable[[Path], object]
    seeds: Callable[[], list[bytes]]
    share: float


@cache
def policy() -> Policy:
    return load_circuits(ROOT / "trained" / "cartpole.pt")


def saved(save: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        save(path)
        return path.read_bytes()


def policies(suffix: str) -> list[bytes]:
    encoder = replace(policy().encoder, function="clip", gain=np.full(len(policy().theta), 0.5))
    later = replace(policy(), encoder=encoder, environment_kwargs={"sutton_barto_reward": True})
    chosen = [policy(), load_policy(ROOT / "trained" / "cartpole_1q.pt"), later]
    return [saved(partial(save_policy, one), f"p{suffix}") for one in chosen]


def wide_policies() -> list[bytes]:
    """A policy file with everything in format 2 that this version cannot run."""
    values = policy_values(policy()) | {"format": "qcompile-policy-2", "decision": "born"}
    block = {"qubits": 4, "gates": [["ry", "x0", 0], ["cz", 0, 1], ["rx", 0.5, 3]]}
    values |= {"circuits": [block], "observables": [[0, 1], [3]], "hold": 2}
    return [json.dumps(values | {"weights": [[0.5, 1.0]] * 2}).encode()]


def use_policy(path: Path) -> object:
    """Read, compile gate by gate, and write."""
    loaded = load_circuits(path)
    if sum(map(len, loaded.program.circuits)) < 200:
        write(compile(loaded.trained_program, IDEAL, 0, loaded.importance).native)
    return loaded


def use_wide_policy(path: Path) -> object:
    """Read and check completely, before the refusal to run."""
    try:
        return load_policy(path)
    except UnsupportedPolicyError as error:
        return error


def networks(suffix: str) -> list[bytes]:
    rng = np.random.default_rng(0)
    dense = [Dense(rng.normal(size=(3, 2)), np.ones(3), "tanh"), Dense(np.ones((2, 3)), np.ones(2))]
    convolution = Convolution(rng.normal(size=(2, 1, 3)), np.zeros(2), "relu")
    layers = [convolution, Dense(rng.normal(size=(2, 8)), np.zeros(2))]
    saved_networks = [
        Network("n", "CartPole-v1", dense, np.zeros(2), np.full(2, 0.5), {"seed": 1}),
        Network("n", "CartPole-v1", layers, environment_kwargs={"sutton_barto_reward": True}),
    ]
    return [saved(partial(save_policy, one), f"n{suffix}") for one in saved_networks]


def use_network(path: Path) -> object:
    """Read, and use for two observations."""
    loaded = load_policy(path)
    assert isinstance(loaded, Network)
    return loaded.logits(np.ones((2, loaded.features)))


def ansatz() -> Ansatz:
    """Circuits to train, with all optional parts."""
    whole = Ansatz.of_policy(policy(), head=True)
    factors = whole.factors.copy()
    factors[0] = 1
    return replace(whole, factors=factors)


def use_ansatz(path: Path) -> object:
    """Read, and make a model of it."""
    loaded = load_ansatz(path)
    if len(loaded.inputs) + len(loaded.parameters) < 200:
        actions = 2 if loaded.bias is None else len(loaded.bias)
        settings = Settings(layout="own", episodes=1)
        make_model(settings, 4, actions, torch.Generator(), loaded)
    return loaded


def checkpoints() -> list[bytes]:
    settings = Settings(episodes=4, reuse=2, pause_at=5.0, critic_hidden=(4,))
    contents = []
    for changed in (settings, settings.changed(model="fcn", hidden=[4], reuse=1)):
        trainer = Trainer("CartPole-v1", changed, 1)
        trainer.train()
        contents.append(saved(partial(save_checkpoint, trainer), "c.pt"))
    own_trainer = Trainer("CartPole-v1", settings.changed(layout="own"), 1, ansatz=ansatz())
    return [*contents, saved(partial(save_checkpoint, own_trainer), "c.pt")]


def devices() -> list[bytes]:
    return read_all(ROOT / "hardware", "ibm_lima.json", "fake_lima.json", "ibm_belem.json")


def use_device(path: Path) -> object:
    device: Device = load_device(path)
    return usable(device)


def calibrations() -> list[bytes]:
    device = load_device("ibm_lima")
    executor = DeviceBackend(device).open(1)
    calibration = calibrate(executor, np.array([0, 2]), 4096, parts=("readout", "response"))
    return [saved(calibration.save, "c.json")]


def observations(kind: str) -> list[bytes]:
    rows = np.random.default_rng(0).normal(size=(3, 4))
    if kind == "npy":
        arrays = (rows, np.asfortranarray(rows), rows[0].astype(">f4"))
        return [saved(partial(np.save, arr=array), "o.npy") for array in arrays]
    text = json.dumps(rows.tolist())
    return [(text if kind == "json" else text[2:-2].replace("], [", "\n")).encode()]


def use_observations(path: Path) -> object:
    return read_observations(path, policy())


QASM3 = b"""OPENQASM 3.0;
include "stdgates.inc";
input angle a;
const float b = 2 * pi / 3;
qubit[3] q;
bit[3] c;
gate twice(t) u { rx(t) u; rz(-t / 2) u; }
gate joined(t) u, v { cx u, v; ctrl @ ry(t) v, u; }
h q;
twice(a + b) q[0];
U(0.1, b, -a) q[1];
inv @ s q[2];
joined(a) q[0], q[2];
negctrl @ pow(2) @ swap q[1], q[2], q[0];
c = measure q;
"""
QASM2 = b"""OPENQASM 2.0;
include "qelib1.inc";
qreg q[3]; creg c[3];
gate mine(t) a { u3(t, 0, pi/2) a; u1(t^2) a; }
gate join(t) a, b { cx a, b; u3(t, 0, 0) b; cx a, b; }
h q[0]; mine(0.3) q[1]; rz(sin(0.2)) q[2];
join(0.7) q[0], q[1]; cz q[1], q[2]; ccx q[0],q[1],q[2];
barrier q;
measure q -> c;
"""


def use_program(path: Path) -> object:
    """Read, compile at level 0, with the marks in their places, and write."""
    source = read_file(path)
    if sum(map(len, source.program.circuits)) < 200 and source.program.bits < 200:
        compile_source(source, IDEAL, 0, "3")
    return source


@cache
def cell() -> Cell:
    tiny = replace(policy(), weights=0.1 * policy().weights)
    return Cell(tiny, DeviceBackend(load_device("ibm_lima")), 16, "none", 2, 3, 5)


def cells() -> list[bytes]:
    result = evaluated.run_cell(cell())
    assert isinstance(result, evaluated.CellResult)
    return [json.dumps(result.model_dump()).encode()]


@cache
def training() -> Training:
    settings = Settings(episodes=3)
    row = Row(
        name="cartpole",
        title="SVQC",
        group="SVQC",
        figure="cartpole",
        environment="CartPole-v1",
        preset="paper",
        settings=settings,
        seeds=(0,),
    )
    return Training(row, 0)


def trainings() -> list[bytes]:
    return [json.dumps(trained.run_cell(training(), 2).model_dump()).encode()]


def studies() -> list[bytes]:
    return [(ROOT / "examples" / "study.toml").read_bytes(), BUILT_IN["paper"].read_bytes()]


def journals() -> list[bytes]:
    values = {"backend": "ibm_lima", "device": load_device("ibm_lima"), "shots": 10, "episodes": 2}
    values |= {"policy": policy_values(policy()), "seed": 0, "level": 2, "mitigation": "none"}
    settings = RunTask.model_validate(values).model_dump(mode="json")
    with (
        tempfile.TemporaryDirectory() as folder,
        Journal.create(Path(folder), "run", "fuzz", settings, {"numpy": "2"}, 60.0) as journal,
    ):
        bits = Register(0, "c", (1, 40), 4)
        for number in range(3):
            submission = journal.note_sending(journal.intend(number, "digest", 40, [bits]), 5)
            journal.note_sent(submission, f"job{number}")
            journal.note_done(submission, [replace(bits, packed=bytes(40))])
            charge = journal.charges.of_job(f"job{number}")
            assert charge is not None
            journal.charges.settle(charge, 2.5)
            journal.steps.note_actions(number, np.ones((2, 4)), np.ones(2, dtype=int))
            journal.steps.note_rewards(number, [1.0, 1.0])
        journal._db.connection.execute("PRAGMA journal_mode = DELETE")  # all in one file
        return [(journal.folder / FILE).read_bytes()]


def use_journal(path: Path) -> object:
    """List, show and export the run, and read its task."""
    with Journal(path.parent) as journal:
        exported(journal)
        costs(journal)
        return task_of(journal)


READERS = {
    "policy .json": Reader("json", "p.json", use_policy, lambda: policies(".json"), 2),
    "policy .pt": Reader("pt", "p.pt", use_policy, lambda: policies(".pt"), 2),
    "policy of blocks": Reader("json", "p.json", use_wide_policy, wide_policies, 1),
    "network .json": Reader("json", "n.json", use_network, lambda: networks(".json"), 1),
    "network .pt": Reader("pt", "n.pt", use_network, lambda: networks(".pt"), 1),
    "circuits to train": Reader(
        "json", "a.json", use_ansatz, lambda: [saved(ansatz().save, "a.json")], 1
    ),
    "checkpoint": Reader("pt", "c.pt", load_checkpoint, checkpoints, 1),
    "device": Reader("json", "d.json", use_device, devices, 2),
    "calibration": Reader("json", "c.json", lambda path: load_backend(str(path)), calibrations, 2),
    "observations .npy": Reader("npy", "o.npy", use_observations, lambda: observations("npy"), 2),
    "observations .json": Reader(
        "json", "o.json", use_observations, lambda: observations("json"), 2
    ),
    "observations .csv": Reader("text", "o.csv", use_observations, lambda: observations("csv"), 2),
    "OpenQASM 3": Reader("text", "p.qasm", use_program, lambda: [QASM3], 1),
    "OpenQASM 2": Reader("text", "p.qasm", use_program, lambda: [QASM2], 1),
    "cell of evaluate": Reader(
        "json",
        f"cells/{cell().name}.json",
        lambda p: evaluated.folder_of(p.parents[1]).read(cell()),
        cells,
        1,
    ),
    "cell of study": Reader(
        "json",
        f"cells/{training().name}.json",
        lambda path: trained.folder_of(path.parents[1]).read(training()),
        trainings,
        1,
    ),
    "study": Reader("text", "s.toml", lambda path: read_rows(path, "s.toml"), studies, 1),
    "journal": Reader("sqlite", FILE, use_journal, journals, 1),
}
