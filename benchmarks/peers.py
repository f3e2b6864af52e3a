"""Compiling and running beside the peers, in one run on one machine: `make bench`."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
from measure import Row, alone, compared, in_turn, seconds, show

import qcompile
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import make_environments
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.policy.layouts import parallel

CIRCUITS, OBSERVATIONS, SHOTS, EPISODES = 24, 1000, 1024, 20
PROGRAM, _ = parallel(8, 3)


def inputs(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan(rng.normal(size=(OBSERVATIONS, CIRCUITS))), rng.normal(size=CIRCUITS)


def bind() -> list[Row]:
    """Native angles of a batch against Qiskit's level-3 pass manager, reused, for one step."""
    from qiskit import QuantumCircuit
    from qiskit.transpiler import generate_preset_pass_manager

    x, theta = inputs(np.random.default_rng(0))
    executable = qcompile.compile(PROGRAM, qcompile.load_device("fake_lima"))
    manager = generate_preset_pass_manager(3, basis_gates=["rz", "sx", "x"])
    circuit = QuantumCircuit(CIRCUITS)
    for qubit in range(CIRCUITS):
        circuit.h(qubit)
        circuit.ry(x[0, qubit], qubit)
        circuit.rz(x[0, qubit], qubit)
        circuit.ry(theta[qubit], qubit)
    circuit.measure_all()
    pairs = in_turn(lambda: executable.bind(x, theta), lambda: manager.run(circuit), 50)
    one = x[:1]
    single = [seconds(lambda: executable.bind(one, theta)) for _ in range(2000)]
    return [
        compared(
            "bind 1,000 x 24 circuits; Qiskit: reused level-3 passes on one 24-qubit circuit; "
            "per circuit",
            pairs,
            ">= 500",
            work=OBSERVATIONS,
        ),
        alone("bind one observation of 24 circuits", single, 1e6, "us", "< 100"),
    ]


def sample() -> list[Row]:
    """A batch with device noise at 1024 shots against one call of Aer's simulator."""
    from qiskit import QuantumCircuit
    from qiskit_aer import AerSimulator
    from qiskit_aer.noise import NoiseModel
    from qiskit_ibm_runtime.fake_provider import FakeLimaV2

    x, theta = inputs(np.random.default_rng(1))
    device = qcompile.load_device("fake_lima")
    executable = qcompile.compile(PROGRAM, device)
    executor = qcompile.OfflineExecutor(device, seed=0)
    angles = executable.bind(x, theta)
    noise = NoiseModel.from_backend_properties(FakeLimaV2().properties())
    simulator = AerSimulator(noise_model=noise)
    circuits = []
    for angle in angles.ravel():
        circuit = QuantumCircuit(1, 1)
        circuit.sx(0)
        circuit.rz(angle, 0)
        circuit.sx(0)
        circuit.measure(0, 0)
        circuits.append(circuit)
    pairs = in_turn(
        lambda: executor.run(executable, x, theta, SHOTS),
        lambda: simulator.run(circuits, shots=SHOTS).result(),
        3,
    )
    return [
        compared(
            "sample 1,000 x 24 circuits with noise, 1024 shots; Aer: the same in one call",
            pairs,
            ">= 2000",
        )
    ]


def episodes(backend: str, shots: int | None, mitigation: str) -> Row:
    """20 lockstep episodes against the same environments stepping the same actions alone."""
    policy = qcompile.load_policy("lunarlander")
    device = qcompile.load_device(backend)
    pairs = []
    for seed in np.repeat(np.arange(8) * 1000, 3).tolist():
        deployment = Deployment(policy, device, shots=shots, mitigation=mitigation, seed=seed)
        actions: list[list[int]] = []
        act = deployment.act

        def recorded(observations: np.ndarray, rows: Rows, act=act, actions=actions) -> np.ndarray:  # type: ignore[no-untyped-def]
            chosen = act(observations, rows)
            actions.append(chosen.tolist())
            return chosen

        deployment.act = recorded  # type: ignore[method-assign]
        ours = play(deployment, EPISODES).wall_seconds
        pairs.append((ours, replay(policy.environment, seed, actions)))
    what = (
        f"run 20 LunarLander episodes on {backend}, {shots or 'exact'} shots, mitigation "
        f"{mitigation}; the same environments alone, with the same actions"
    )
    return compared(what, pairs, "<= 1.3", slower=True)


def replay(name: str, seed: int, actions: list[list[int]]) -> float:
    """Seconds that the environments need to step recorded actions, resets included."""
    environments = make_environments(name, EPISODES)
    start = time.perf_counter()
    for episode, environment in enumerate(environments):
        environment.reset(seed=seed + episode)
    alive = list(range(EPISODES))
    for chosen in actions:
        alive = [
            i
            for i, action in zip(alive, chosen, strict=True)
            if not any(environments[i].step(action)[2:4])
        ]
    assert not alive, "the replay did not follow the run"
    return time.perf_counter() - start


def start_up() -> Row:
    """The command line's help, as a whole process."""
    command = [sys.executable, "-m", "qcompile", "--help"]
    times = [
        seconds(lambda: subprocess.run(command, check=True, capture_output=True)) for _ in range(10)
    ]
    return alone("qcompile --help", times, 1.0, "s", "< 0.3")


def rows() -> list[Row]:
    return [
        *bind(),
        *sample(),
        episodes("ibm_lima", 8192, "readout"),
        episodes("ideal", None, "none"),
        start_up(),
    ]


if __name__ == "__main__":
    show(rows, "Compiling and running beside the peers.")
