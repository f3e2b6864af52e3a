"""The quality of calibrations and their tests: lost fits, false alarms, p-values and power.

Clean devices are noise models that satisfy every test's assumptions; in `Neighbours` some bits are
read from the neighbouring qubit.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from measure import Row, alone, seconds, show, spread
from scipy.stats import kstest

import qcompile
from qcompile.calibration import Calibration
from qcompile.deploy.twin_check import check_twin, wide_observations
from qcompile.deploy.twin_power import EFFECT, choose_check
from qcompile.device import IDEAL, Device
from qcompile.mitigation import calibrate, measure_drift, misfits
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.noise import usable

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from noisy import Neighbours

CLEAN = ("fake_lima", "fake_toronto", "fake_lagos")
FITTED, TESTED = 300, 200


def live(executor, qubits, shots: int = 8192) -> Calibration:  # type: ignore[no-untyped-def]
    """A calibration as measured by `calibrate --live`."""
    angles = LIVE_ANGLES_RAD
    return calibrate(executor, qubits, shots, parts=["response"], angles_rad=angles)


def lost() -> list[Row]:
    """Lost fits of perfect qubits, whose curves lie on the border of the cone."""
    rows = []
    for shots in (1024, 8192):
        calibrations = [
            live(qcompile.OfflineExecutor(IDEAL, seed), np.arange(24), shots)
            for seed in range(FITTED)
        ]
        share = 100 * float(np.mean([c.response is None for c in calibrations]))
        rows.append(spread(f"24 perfect qubits, {shots} shots: fits lost", [share], "%", "0"))
    for what, device, qubits in (
        ("24 perfect qubits", IDEAL, np.arange(24)),
        ("27 of fake_toronto", qcompile.load_device("fake_toronto"), np.arange(27)),
    ):
        executor = qcompile.OfflineExecutor(device, 0)
        times = [seconds(lambda e=executor, q=qubits: live(e, q)) for _ in range(30)]  # type: ignore[misc]
        rows.append(alone(f"calibrate {what}, six angles", times, 1e3, "ms", ""))
    return rows


def neighbours() -> list[Row]:
    """How often a calibration is doubted, on clean devices and with neighbours read."""
    rows = []
    for name in CLEAN:
        device = qcompile.load_device(name)
        qubits = np.array(usable(device))
        for shots in (1024, 8192):
            doubted = [
                bool(misfits(calibrate(qcompile.OfflineExecutor(device, seed), qubits, shots)))
                for seed in range(FITTED)
            ]
            what = f"{name}, clean, {shots} shots: calibrations doubted"
            rows.append(spread(what, [100 * float(np.mean(doubted))], "%", "0.1"))
    device, policy = qcompile.load_device("fake_toronto"), qcompile.load_policy("lunarlander")
    executable = qcompile.compile(policy.trained_program, device, importance=policy.importance)
    for share in (0.02, 0.05, 0.1, 0.2):
        doubted = []
        for seed in range(30):
            calibration = live(Neighbours(device, share, seed), np.unique(executable.qubits))
            doubted.append(len({misfit.qubit for misfit in misfits(calibration)}))
        what = f"fake_toronto, {100 * share:g} % of each bit the neighbour's: qubits doubted of 24"
        rows.append(spread(what, [float(count) for count in doubted], "qubits", ""))
    return rows


def uniform(what: str, p_values: np.ndarray) -> Row:
    """The p-value of Kolmogorov's and Smirnov's test against the uniform distribution."""
    return spread(
        f"{what}: Kolmogorov and Smirnov's p-value of {p_values.size} p-values",
        [float(kstest(p_values.ravel(), "uniform").pvalue)],
        "",
        "> 0.001",
    )


def p_values() -> list[Row]:
    """P-values of `validate` and `calibrate --check` when nothing changed."""
    rows = []
    for name in ("fake_lima", "fake_toronto"):
        device, policy = qcompile.load_device(name), qcompile.load_policy("lunarlander")
        executable = qcompile.compile(policy.trained_program, device, importance=policy.importance)
        qubits = np.unique(executable.qubits)
        first = live(qcompile.OfflineExecutor(device, 0), qubits)
        observations, shots, _ = choose_check(first, policy, wide_observations(policy, first, 0))
        checks, drifts = [], list[np.ndarray]()
        for seed in range(TESTED):
            machine = qcompile.OfflineExecutor(device, seed)
            twin = live(machine, qubits)
            checks.append(check_twin(twin, policy, observations, machine, shots).p_value)
            pair = [calibrate(machine, qubits) for _ in range(2)]
            drifts.append(measure_drift(*pair).p_value)
        rows.append(uniform(f"validate on {name}, {shots} shots", np.array(checks)))
        rows.append(uniform(f"--check on {name}, 8192 shots", np.array(drifts)))
    return rows


def power() -> list[Row]:
    """How often `validate` and `--check` detect a p01 of one qubit raised by EFFECT."""
    device, policy = qcompile.load_device("fake_toronto"), qcompile.load_policy("lunarlander")
    executable = qcompile.compile(policy.trained_program, device, importance=policy.importance)
    qubits = np.unique(executable.qubits)
    detected, stated, named = [], [], []
    for seed in range(TESTED):
        qubit = int(qubits[seed % len(qubits)])
        records = list(device.qubits)
        records[qubit] = records[qubit].model_copy(update={"p01": records[qubit].p01 + EFFECT})
        moved = Device(**device.model_dump() | {"qubits": tuple(records)})
        twin = live(qcompile.OfflineExecutor(device, seed), qubits)
        if seed % 20 == 0:
            observations, shots, _ = choose_check(
                twin, policy, wide_observations(policy, twin, seed)
            )
        machine = qcompile.OfflineExecutor(moved, 10_000 + seed)
        check = check_twin(twin, policy, observations, machine, shots)
        detected.append(qubit in check.failed)
        named.append(check.failed in ([], [qubit]))
        stated.append(check.power[check.qubits.tolist().index(qubit)])
    what = f"validate, lunarlander on fake_toronto: a p01 raised by {EFFECT:g} on one of 24 qubits"
    cost = f"{len(observations)} observations, {shots} shots"
    return [
        spread(f"{what}, found ({cost})", [100 * float(np.mean(detected))], "%", ">= 90"),
        spread(f"{what}, power stated", [100 * float(np.mean(stated))], "%", ""),
        spread(f"{what}, no other qubit named", [100 * float(np.mean(named))], "%", ""),
    ]


def rows() -> list[Row]:
    return [*lost(), *neighbours(), *p_values(), *power()]


if __name__ == "__main__":
    show(rows, "The quality of calibrations and their tests.")
