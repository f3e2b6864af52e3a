"""The remaining errors of <Z> after mitigation, and its speed, beside mthree: `make bench`.

Random product circuits. mthree gets the same counts and the same calibration counts; the inverse
with the true matrices, clipped to [-1, 1] like ours, is the best possible.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from measure import Row, compared, seconds, show, spread

import qcompile
from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.mitigation import (
    CALIBRATION_SHOTS,
    Mitigation,
    calibrate,
    predistorted,
    readout_mitigation,
    response_mitigation,
)
from qcompile.passes import Executable
from qcompile.policy.layouts import parallel

try:
    import mthree
except ImportError:
    mthree = None

SEEDS, ROWS, BATCH, CIRCUITS = range(12), 300, 1000, 24


def noiseless_gates(name: str) -> Device:
    """The device with its own readout errors, asymmetric, and perfect gates."""
    device = qcompile.load_device(name)
    qubits = tuple(qubit.model_copy(update={"gates": {}}) for qubit in device.qubits)
    return device.model_copy(update={"qubits": qubits})


def true_inverse(executable: Executable) -> Mitigation:
    qubits = [executable.device.qubits[q] for q in executable.qubits]
    shift, contrast = np.array([(q.p01 - q.p10, q.contrast) for q in qubits]).T
    nothing = np.zeros(len(qubits))
    return Mitigation(shift, contrast, nothing, np.zeros((len(qubits), 3, 3)))


def peer(calibration: Calibration, executable: Executable):  # type: ignore[no-untyped-def]
    """mthree with the frequencies of the calibration for the qubits of the circuits."""
    counts = calibration.readout_counts
    assert counts is not None
    assert counts.shots is not None
    prepared, frequency = np.array(counts.prepared), np.array(counts.ones) / counts.shots
    half = len(prepared) / 2
    p_one = [(frequency * (prepared == bit)).sum(axis=0) / half for bit in (0, 1)]
    rows = calibration.rows(executable.qubits)
    matrices = [
        np.array([[1 - p_one[0][r], 1 - p_one[1][r]], [p_one[0][r], p_one[1][r]]]) for r in rows
    ]
    mitigation = mthree.M3Mitigation()
    mitigation.cals_from_matrices(matrices)
    return mitigation


def by_mthree(mitigation, bits: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    """<Z> of each qubit from joint bits (shots, qubits), as mthree is meant to be used."""
    count = bits.shape[1]
    words = Counter(row.tobytes() for row in np.ascontiguousarray((bits + 48)[:, ::-1], np.uint8))
    quasi = mitigation.apply_correction({k.decode(): v for k, v in words.items()}, range(count))
    return np.array([quasi.expval("I" * (count - 1 - q) + "Z" + "I" * q) for q in range(count)])


def marginals(mitigation) -> list:  # type: ignore[type-arg,no-untyped-def]
    """mthree for each qubit separately."""
    mitigations = []
    for matrix in mitigation.single_qubit_cals:
        mitigations.append(mthree.M3Mitigation())
        mitigations[-1].cals_from_matrices([matrix])
    return mitigations


def by_marginals(singles: list, ones: list[int], shots: int) -> list[float]:  # type: ignore[type-arg]
    return [
        single.apply_correction({"0": shots - k, "1": k}, [0]).expval()
        for single, k in zip(singles, ones, strict=True)
    ]


def readout_errors(name: str, circuits: int, shots: int, *, beside: bool) -> dict[str, list[float]]:
    """Mean absolute errors of <Z>, one for each seed."""
    device = noiseless_gates(name)
    executable = qcompile.compile(parallel(circuits, 1)[0], device)
    errors: dict[str, list[float]] = {"none": [], "ours": [], "true": []}
    errors |= {"mthree": [], "mthree on marginals": []}
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        x, theta = rng.uniform(-1.5, 1.5, (ROWS, circuits)), rng.uniform(-3, 3, circuits)
        ideal = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)
        executor = qcompile.OfflineExecutor(device, seed)
        calibration = calibrate(executor, executable.qubits, parts=["readout"])
        p_one = (1 - executor.expectation(executable, x, theta)) / 2
        bits = rng.random((ROWS, shots, circuits)) < p_one[:, None] if beside else None
        ones = rng.binomial(shots, p_one) if bits is None else bits.sum(axis=1)
        z = 1 - 2 * ones / shots
        estimates = {
            "none": z,
            "ours": readout_mitigation(calibration, executable).apply(z),
            "true": true_inverse(executable).apply(z),
        }
        if bits is not None:
            mitigation = peer(calibration, executable)
            estimates["mthree"] = np.array([by_mthree(mitigation, row) for row in bits])
            singles = marginals(mitigation)
            estimates["mthree on marginals"] = np.array(
                [by_marginals(singles, row, shots) for row in ones.tolist()]
            )
        for which, values in estimates.items():
            errors[which].append(float(np.abs(values - ideal).mean()))
    return errors


def accuracy(name: str, circuits: int, shots: int, wanted: float, beside: bool) -> list[Row]:
    errors = readout_errors(name, circuits, shots, beside=beside)
    what = f"readout mitigation of {circuits} circuits on {name}, {shots} shots"
    means = ", ".join(f"{k} {np.mean(v):.5f}" for k, v in errors.items() if v)
    rows = [
        spread(
            f"{what}: mean error of <Z> ({means}) to that with the true matrices",
            (np.array(errors["ours"]) / errors["true"]).tolist(),
            "times the error",
            f"<= {wanted}",
        )
    ]
    if beside:
        for which in ("mthree", "mthree on marginals"):
            ratios = (np.array(errors["ours"]) / errors[which]).tolist()
            rows.append(spread(f"{what}: mean error to {which}", ratios, "times the error", "<= 1"))
    return rows


def speed() -> list[Row]:
    """24 mitigated expectations, ours in batches of 1,000, mthree's of marginals one by one."""
    device = noiseless_gates("fake_toronto")
    executable = qcompile.compile(parallel(CIRCUITS, 1)[0], device)
    calibration = calibrate(qcompile.OfflineExecutor(device, 0), executable.qubits)
    ours = readout_mitigation(calibration, executable)
    tilted = response_mitigation(calibration, executable)
    tilted = Mitigation(tilted.offset, tilted.contrast, tilted.tilt + 0.01, tilted.covariance)
    ones = np.random.default_rng(0).integers(0, 1024, (BATCH, CIRCUITS))
    z = 1 - 2 * ones / 1024
    singles = marginals(peer(calibration, executable)) if mthree is not None else []

    def theirs() -> None:
        by_marginals(singles, ones[0].tolist(), 1024)

    ours.apply(z)
    rows = []
    for what, mitigation in (("readout", ours), ("response with tilts", tilted)):
        times = [seconds(lambda m=mitigation: m.apply(z)) / BATCH * 1e6 for _ in range(200)]  # type: ignore[misc]
        rows.append(spread(f"undo {what}, 24 circuits in batches of 1,000", times, "us", "<= 20"))
    if singles:
        theirs()
        pairs = [(seconds(lambda: ours.apply(z)), seconds(theirs)) for _ in range(50)]
        rows.append(
            compared(
                "undo readout, 24 circuits; mthree: their marginals, each row alone",
                pairs,
                ">= 100",
                work=BATCH,
            )
        )
    return rows


def gate_errors(shots: int = 8192) -> list[Row]:
    """The remaining errors of LunarLander's circuits on fake_toronto, gates and readout."""
    device, policy = qcompile.load_device("fake_toronto"), qcompile.load_policy("lunarlander")
    executable = qcompile.compile(policy.trained_program, device, importance=policy.importance)
    x = policy.encode(
        np.random.default_rng(0).normal(size=(ROWS, policy.encoder.feature.max() + 1))
    )
    none = np.zeros(0)
    ideal_executable = qcompile.compile(policy.trained_program)
    ideal = qcompile.OfflineExecutor(ideal_executable.device).expectation(ideal_executable, x, none)
    exact = qcompile.OfflineExecutor(device).expectation(executable, x, none)
    undone: dict[str, list[np.ndarray]] = {"readout": [], "response": [], "predistorted": []}
    noisy: dict[str, list[float]] = {"none": [], "readout": [], "response": [], "predistorted": []}
    reached: list[float] = []
    share: list[float] = []
    for seed in SEEDS:
        executor = qcompile.OfflineExecutor(device, seed)
        calibration = calibrate(executor, executable.qubits)
        mitigations = {
            "readout": readout_mitigation(calibration, executable),
            "response": response_mitigation(calibration, executable),
        }
        changed = predistorted(executable, calibration)
        z = 1 - 2 * executor.run(executable, x, none, shots) / shots
        z_predistorted = 1 - 2 * executor.run(changed, x, none, shots) / shots
        for which, mitigation in mitigations.items():
            undone[which].append(mitigation.apply(exact))
            noisy[which].append(float(np.abs(mitigation.apply(z) - ideal).mean()))
        undone["predistorted"].append(executor.expectation(changed, x, none))
        noisy["none"].append(float(np.abs(z - ideal).mean()))
        noisy["predistorted"].append(float(np.abs(z_predistorted - ideal).mean()))
        response = mitigations["response"]
        in_reach = np.abs(ideal - response.offset) <= response.contrast
        reached.append(
            float(
                np.abs(z_predistorted - ideal)[in_reach].mean()
                / np.abs(response.apply(z) - ideal)[in_reach].mean()
            )
        )
        share.append(float(in_reach.mean()))
    left = {"none": np.abs(exact - ideal).mean(axis=0)}
    left |= {k: np.abs(np.mean(v, axis=0) - ideal).mean(axis=0) for k, v in undone.items()}
    worst = int(np.argmax(left["none"]))
    rows = [
        spread(
            f"systematic error of <Z> on fake_toronto's qubit {executable.qubits[at]} ({where}), "
            f"{which}: {left[which][at]:.5f} of {left['none'][at]:.5f}; removed",
            [100 * float(1 - left[which][at] / left["none"][at])],
            "%",
            ">= 90" if which == "response" else "",
        )
        for where, at in (("worst", worst), ("worst after readout", int(left["readout"].argmax())))
        for which in ("readout", "response", "predistorted")
    ]
    rows.append(
        spread(
            f"what readout leaves of it on all qubits ({left['readout'].mean():.5f}); response "
            f"leaves {left['response'].mean():.5f}, removed of readout's",
            [100 * float(1 - left["response"].mean() / left["readout"].mean())],
            "%",
            "",
        )
    )
    means = ", ".join(f"{k} {np.mean(v):.5f}" for k, v in noisy.items())
    what = f"predistorted angles, {shots} shots: mean error of <Z> ({means})"
    ratios = {
        other: np.array(noisy["predistorted"]) / noisy[other] for other in ("readout", "response")
    }
    ratios["response, where the curve reaches"] = np.array(reached)
    what += f", {np.mean(share):.2f} of <Z> within reach,"
    return rows + [
        spread(
            f"{what} to that of {other}",
            ratio.tolist(),
            "times the error",
            "< 1" if "reaches" in other else "",
        )
        for other, ratio in ratios.items()
    ]


def rows() -> list[Row]:
    beside = mthree is not None
    return [
        *accuracy("fake_lima", 5, 8192, 1.03, beside),
        *accuracy("fake_lima", 5, 1024, 1.03, beside),
        *accuracy("fake_toronto", CIRCUITS, 8192, 1.05, False),
        *speed(),
        *gate_errors(),
    ]


if __name__ == "__main__":
    show(rows, f"Mitigation beside mthree; calibrations of {CALIBRATION_SHOTS} shots.")
