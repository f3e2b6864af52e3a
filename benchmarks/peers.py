"""Speed beside the peers, in one run on one machine: `make bench`.

qcompile and the peer are measured in turn, and a ratio is the median over the pairs, with the
quartiles beside it: machines drift, pairs do not. Seconds are medians too, for orientation.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

import qcompile
from qcompile.policy.layouts import parallel
from qcompile.report.tables import print_table
from qcompile.rl.environments import make_environments, reset_all
from qcompile.rl.evaluate import Deployment, play

CIRCUITS, OBSERVATIONS, SHOTS, EPISODES = 24, 1000, 1024, 20
PROGRAM, _ = parallel(8, 3)


@dataclass(frozen=True)
class Row:
    """A figure with its quartiles, what it is of, and what is wanted of it."""

    what: str
    qcompile_s: float
    peer_s: float | None
    figure: float
    quartiles: tuple[float, float]
    unit: str
    wanted: str


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def in_turn(
    ours: Callable[[], object], theirs: Callable[[], object], pairs: int
) -> list[tuple[float, float]]:
    """Seconds of both, measured in turn after one warm-up of ours."""
    ours()
    return [(seconds(ours), seconds(theirs)) for _ in range(pairs)]


def compared(
    what: str,
    pairs: list[tuple[float, float]],
    wanted: str,
    *,
    work: float = 1.0,
    slower: bool = False,
) -> Row:
    """A row of measured pairs; `work` is how many times the peer's work ours did.

    The figure is how many times faster qcompile is, or with `slower` how many times the time.
    """
    ratios = [ours / theirs if slower else theirs / ours * work for ours, theirs in pairs]
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    ours, theirs = np.median(pairs, axis=0)
    unit = "times the time" if slower else "times faster"
    return Row(
        what, float(ours), float(theirs), float(middle), (float(low), float(high)), unit, wanted
    )


def alone(what: str, times: list[float], factor: float, unit: str, wanted: str) -> Row:
    """A row without a peer; the figure is the median in `unit`, seconds times `factor`."""
    low, middle, high = np.percentile(times, [25, 50, 75]).tolist()
    return Row(what, middle, None, middle * factor, (low * factor, high * factor), unit, wanted)


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

        def recorded(observations: np.ndarray, act=act, actions=actions) -> np.ndarray:  # type: ignore[no-untyped-def]
            chosen = act(observations)
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
    reset_all(environments, [seed + i for i in range(EPISODES)])
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    as_json = parser.parse_args().json
    rows = [
        *bind(),
        *sample(),
        episodes("ibm_lima", 8192, "readout"),
        episodes("ideal", None, "none"),
        start_up(),
    ]
    if as_json:
        print(json.dumps([asdict(row) for row in rows], indent=1))  # noqa: T201
        return
    print_table(
        ["what; the peer", "qcompile, s", "peer, s", "figure", "wanted"],
        [
            [
                row.what,
                f"{row.qcompile_s:.3g}",
                "" if row.peer_s is None else f"{row.peer_s:.3g}",
                f"{row.figure:.4g} {row.unit} ({row.quartiles[0]:.4g} to {row.quartiles[1]:.4g})",
                row.wanted,
            ]
            for row in rows
        ],
    )


if __name__ == "__main__":
    main()
