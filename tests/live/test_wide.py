"""Live runs with circuits of several qubits: killed and resumed, read again, and by their law."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
from base64 import b64decode
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_ledger import settled_wrong
from live_runs import LIMIT_S, Runs, check_paid_once, killed, played, surprises
from qiskit.quantum_info import Statevector
from standin import StandIn
from wide_policies import policy

from qcompile.device import Device
from qcompile.execution import PrimitiveExecutor
from qcompile.ir import Circuit, Program
from qcompile.live.connection import Connection
from qcompile.live.perform import begin, complete
from qcompile.live.play import RunTask
from qcompile.passes import compile
from qcompile.passes.route import route
from qcompile.policy import save_policy
from qcompile.policy.files import policy_values
from qcompile.streams import Draws

SETTINGS = {"shots": 64, "max_steps": 6, "calibration_shots": 300, "speculate": 3, "copies": 1}
PLAY = (
    *("run", "ring.json", "--backend", "fake_lima", "--live", "--yes", "--json"),
    *("--episodes", "2", "--max-qpu-seconds", f"{LIMIT_S:g}"),
    *(str(w) for key, v in SETTINGS.items() for w in (f"--{key.replace('_', '-')}", v)),
)
OBSERVABLES = policy().program.measured
Make = Callable[..., PrimitiveExecutor]


@pytest.fixture(autouse=True)
def _policy_file(empty_folder: Path) -> None:
    save_policy(replace(policy(), hold=2), "ring.json")


@pytest.fixture(scope="module")
def unkilled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """The result of the run when nothing goes wrong."""
    with pytest.MonkeyPatch.context() as patch, StandIn() as standin:
        for name, value in standin.environment().items():
            patch.setenv(name, value)
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        task = RunTask.model_validate(
            {
                "backend": "fake_lima",
                "device": Connection("fake_lima").device(),
                "policy": policy_values(replace(policy(), hold=2)),
                "episodes": 2,
                "mitigation": "readout",
                **SETTINGS,
            }
        )
        yield played(complete(begin(tmp_path_factory.mktemp("runs"), task, LIMIT_S)))


@pytest.mark.parametrize(
    ("request_", "times", "pause_s"),
    [
        ("POST /jobs", 1, 0.0),  # the calibration of the qubits used
        ("POST /jobs", 2, 0.05),
        ("GET /jobs/{id}/results", 1, 0.0),
        ("GET /jobs/{id}/results", 2, 0.02),
    ],
)
def test_a_killed_run_goes_on(
    runs: Runs, unkilled: dict[str, Any], request_: str, times: int, pause_s: float
) -> None:
    """Held, measured ahead, and its products mitigated; nothing is paid for twice."""
    runs.service.settings.run_seconds = 0.1
    killed(runs.service, PLAY, request_, times, pause_s)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == unkilled
    assert (found["mitigation"], found["hold"], found["decisions"]) == ("readout", 2, 6)
    check_paid_once(runs.service, found["jobs"])
    assert not settled_wrong(found, runs.service.ledger().charged_seconds)


def in_new_process(*words: str) -> Any:
    """What the command line prints in a process of its own, without any service."""
    call = [sys.executable, "-m", "qcompile", *words]
    return json.loads(subprocess.run(call, check=True, capture_output=True).stdout)


def test_another_process_reads_the_journal(runs: Runs) -> None:
    """Its bits are those that the run decided by: every action again, from parities by hand."""
    result = runs.call(*PLAY, "--mitigation", "none").json()
    record = in_new_process("runs", "export", "last")
    shown = in_new_process("runs", "show", "last", "--json")["result"]
    assert record["result"]["episodes"] == shown["episodes"] == result["episodes"]
    assert record["settings"]["policy"]["circuits"][0]["qubits"] == 3
    for job, step in zip(record["jobs"], record["steps"], strict=True):
        [register] = job["measured"]
        packed = np.frombuffer(b64decode(register["packed"]), np.uint8)
        bits = np.unpackbits(packed.reshape(*register["shape"], 1), axis=-1)[..., :-5:-1]
        assert register["shape"] == [len(step["observations"]), 64]
        assert bits.sum(axis=1).tolist() == register["ones"]
        odd = [(bits[..., list(o)].sum(axis=2) % 2).mean(axis=1) for o in OBSERVABLES]
        draws = Draws(0, 2).actions(np.array(step["episode"]), np.array(step["decision"]))
        z = 1 - 2 * np.transpose(odd)
        assert policy().decide(z, draws).tolist() == step["actions"]


def test_a_journal_is_played_again_for_nothing(runs: Runs) -> None:
    first = runs.call(*PLAY).json()
    before = runs.service.ledger().jobs
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        db.execute("UPDATE run SET result = NULL")
    again = runs.call("resume", "last", "--json")
    assert again.code == 0, again.err
    assert played(again.json()) == played(first)
    assert runs.service.ledger().jobs == before


def test_another_routing_is_no_replay(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """As another version of Qiskit might choose: the run stops, and nothing is sent or lost."""
    runs.call(*PLAY)
    before = runs.service.ledger().jobs
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        db.execute("UPDATE run SET result = NULL")
    first = route(policy().trained_program.circuits[0], Connection("fake_lima").device())
    assert first is not None
    avoided = int(first.qubits[0])

    def other(circuit: Circuit, device: Device, *, taken: Collection[int], **_: Any) -> Any:
        return route(circuit, device, taken={*taken, avoided})

    monkeypatch.setattr("qcompile.passes.place_wide.route", other)
    again = runs.call("resume", "last", "--json")
    assert again.code == 1
    assert "differs from the one that was sent." in again.err
    assert "The versions are the same." in again.err
    assert runs.service.ledger().jobs == before


def test_counts_follow_the_state_and_the_readout(executor_on: Make, service: StandIn) -> None:
    """The stand-in's machines have no noise but that of readout where circuits entangle."""
    executor, shots = executor_on("fake_lima"), 20_000
    gates = "ry(x0)@0 cz@0,1 ry(x1)@1 cx@1,2 ry(x0)@2 ecr@0,2 rx(x1)@0 h@2 ry(0.4)@1"
    products = ((2,), (0, 1), (0, 2), (0, 1, 2), (1,), (3,), (0,))
    circuits = [Circuit.parse(gates, 3), Circuit.parse("ry(x1)")]
    program = replace(Program.of(circuits, 2), observables=products)
    executable = compile(program, executor.device)
    x = np.random.default_rng(0).uniform(-2, 2, (5, 2))
    odd = executor.run(executable, x, np.zeros(0), shots)
    [job] = service.ledger().jobs
    assert job.executions == 5 * executable.round_count * shots
    expected = [read_out(program, values, executable) for values in x]
    assert not surprises(odd, shots, np.array(expected)).any()
    assert surprises(np.roll(odd, 1, axis=1), shots, np.array(expected)).mean() > 0.6


def read_out(program: Program, x: np.ndarray, executable: Any) -> list[float]:
    """P(odd) of each observable: Qiskit's state of the program, then the machine's readout."""
    from qiskit import QuantumCircuit

    built = QuantumCircuit(program.bits)
    values = dict(zip(program.inputs, x.tolist(), strict=True))
    for first, circuit in zip(program.first_bits, program.circuits, strict=True):
        for gate in circuit.substitute(values).gates:
            angle = () if gate.angle is None else (gate.angle.constant,)
            getattr(built, gate.name)(*angle, *(first + qubit for qubit in gate.qubits))
    p = Statevector(built).probabilities().reshape((2,) * program.bits)
    p = p.transpose(range(program.bits)[::-1])  # the first qubit first
    for axis, number in enumerate(executable.bit_qubits):
        qubit = executable.device.qubits[number]
        errors = [[1 - qubit.p10, qubit.p01], [qubit.p10, 1 - qubit.p01]]
        p = np.moveaxis(np.tensordot(errors, p, (1, axis)), 0, axis)
    outcomes = np.indices(p.shape)
    return [float((p * (outcomes[list(o)].sum(axis=0) % 2)).sum()) for o in program.measured]
