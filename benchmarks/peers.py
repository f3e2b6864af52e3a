"""Speed beside the peers, in one run on one machine: `make bench`.

Every ratio is a median over repetitions that alternate between qcompile and the peer, so that a
machine whose speed drifts does not favour either. Absolute times are printed for orientation.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import qcompile
from qcompile.policy.layouts import parallel
from qcompile.report.tables import print_table
from qcompile.rl.environments import make_environments, reset_all
from qcompile.rl.evaluate import Deployment, play

CIRCUITS, OBSERVATIONS, SHOTS = 24, 1000, 1024
PROGRAM, _ = parallel(8, 3)
Row = tuple[str, float, float, float, str]


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def side_by_side(
    ours: Callable[[], object], theirs: Callable[[], object], repeats: int
) -> tuple[float, float]:
    """Median seconds of both, measured in turn after one warm-up each."""
    ours(), theirs()
    pairs = [(seconds(ours), seconds(theirs)) for _ in range(repeats)]
    return statistics.median(p[0] for p in pairs), statistics.median(p[1] for p in pairs)


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
    ours, theirs = side_by_side(lambda: executable.bind(x, theta), lambda: manager.run(circuit), 50)
    ours, theirs = ours / (OBSERVATIONS * CIRCUITS), theirs / CIRCUITS
    one = x[:1]
    single = statistics.median(seconds(lambda: executable.bind(one, theta)) for _ in range(2000))
    return [
        ("bind, per circuit, against Qiskit level 3", ours, theirs, theirs / ours, ">= 500"),
        (
            "bind a single observation of 24 circuits",
            single,
            float("nan"),
            single * 1e6,
            "us, < 100",
        ),
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
    ours = statistics.median(
        seconds(lambda: executor.run(executable, x, theta, SHOTS)) for _ in range(20)
    )
    theirs = seconds(lambda: simulator.run(circuits, shots=SHOTS).result())
    again = statistics.median(
        seconds(lambda: executor.run(executable, x, theta, SHOTS)) for _ in range(20)
    )
    ours = max(ours, again)
    return [
        (
            "sample 1,000 x 24 circuits with noise, against Aer",
            ours,
            theirs,
            theirs / ours,
            ">= 2000",
        )
    ]


def episodes() -> list[Row]:
    """20 lockstep episodes against the same environments stepping the same actions alone."""
    policy = qcompile.load_policy("lunarlander")
    device = qcompile.load_device("ibm_lima")
    pairs = []
    for seed in range(5):
        deployment = Deployment(policy, device, shots=8192, mitigation="readout", seed=1000 * seed)
        actions: list[list[int]] = []
        act = deployment.act

        def recorded(observations: np.ndarray, act=act, actions=actions) -> np.ndarray:  # type: ignore[no-untyped-def]
            chosen = act(observations)
            actions.append(chosen.tolist())
            return chosen

        deployment.act = recorded  # type: ignore[method-assign]
        ours = play(deployment, 20).wall_seconds
        pairs.append((ours, replay(policy.environment, 1000 * seed, actions)))
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b for a, b in pairs)
    return [
        ("20 LunarLander episodes, against the environments alone", ours, theirs, ratio, "<= 1.3")
    ]


def replay(name: str, seed: int, actions: list[list[int]]) -> float:
    environments = make_environments(name, 20)
    start = time.perf_counter()
    reset_all(environments, [seed + i for i in range(20)])
    alive = list(range(20))
    for chosen in actions:
        alive = [
            i
            for i, action in zip(alive, chosen, strict=True)
            if not any(environments[i].step(action)[2:4])
        ]
    assert not alive, "the replay did not follow the run"
    return time.perf_counter() - start


def start_up() -> list[Row]:
    """The command line's help."""
    command = [sys.executable, "-m", "qcompile", "--help"]
    median = statistics.median(
        seconds(lambda: subprocess.run(command, check=True, capture_output=True)) for _ in range(10)
    )
    return [("qcompile --help", median, float("nan"), median, "s, < 0.3")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    as_json = parser.parse_args().json
    rows = [row for part in (bind, sample, episodes, start_up) for row in part()]
    columns = ["what", "qcompile_s", "peer_s", "figure", "wanted"]
    if as_json:
        values = [
            {k: None if v != v else v for k, v in zip(columns, row, strict=True)} for row in rows
        ]
        print(json.dumps(values, indent=1))  # noqa: T201
    else:
        shown = [
            [r[0], f"{r[1]:.3g}", "" if r[2] != r[2] else f"{r[2]:.3g}", f"{r[3]:.3g}", r[4]]
            for r in rows
        ]
        print_table(["what", "qcompile, s", "peer, s", "figure", "wanted"], shown)


if __name__ == "__main__":
    main()
