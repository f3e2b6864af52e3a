"""The remaining errors of <ZZ> and <ZZZZ> after mitigation, beside mthree: `make bench`.

Random parameters of a circuit of 4 qubits that entangles, with asymmetric readout and perfect
gates, so that readout is the only error. mthree gets the same outcomes and the same calibration
counts; the inverse with the true matrices, clipped to [-1, 1] like ours, is the best possible.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from entangled import reuploading
from measure import Row, show, spread
from mitigation import SEEDS, mthree, peer

import qcompile
from qcompile.device import Device
from qcompile.mitigation import CALIBRATION_SHOTS, calibrate
from qcompile.mitigation.products import ProductMitigation, product_mitigation, with_sub_products
from qcompile.passes import Executable
from qcompile.states.parities import signed_sums

QUBITS, ROWS = 4, 200
OBSERVABLES = ((0, 1), (1, 2), (2, 3), (0, 3), (0, 1, 2, 3))


def noiseless_gates(name: str) -> Device:
    """The device with its readout errors and couplings, and perfect gates."""
    values = qcompile.load_device(name).model_dump()
    for qubit in values["qubits"]:
        qubit["gates"] = {}
    for coupling in values["couplings"]:
        coupling |= {"error": 0.0, "length_ns": 0.0}
    return Device.model_validate(values)


def with_true_matrices(undo: ProductMitigation, executable: Executable) -> ProductMitigation:
    qubits = [executable.device.qubits[qubit] for qubit in executable.bit_qubits]
    offset, contrast = np.array([(q.p01 - q.p10, q.contrast) for q in qubits]).T
    return replace(undo, offset=offset, contrast=contrast)


def all_products() -> tuple[tuple[int, ...], ...]:
    """Number n has the qubits whose bit is set in n, the first qubit's highest; 0 is left out."""
    return tuple(
        tuple(q for q in range(QUBITS) if number >> (QUBITS - 1 - q) & 1)
        for number in range(1, 2**QUBITS)
    )


def errors(shots: int) -> dict[str, list[np.ndarray]]:
    """Mean absolute errors of each observable, one array for each seed."""
    device = noiseless_gates("fake_lima")
    program = replace(reuploading(QUBITS), observables=OBSERVABLES)
    executable = qcompile.compile(with_sub_products(program), device)
    everything = replace(program, observables=all_products())
    on_device = qcompile.compile(everything, device)
    perfect = qcompile.compile(program)
    found: dict[str, list[np.ndarray]] = {"none": [], "ours": [], "true": [], "mthree": []}
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        x = rng.uniform(-1.5, 1.5, (ROWS, QUBITS))
        theta = rng.uniform(-3, 3, len(program.parameters))
        ideal = qcompile.OfflineExecutor(perfect.device).expectation(perfect, x, theta)
        executor = qcompile.OfflineExecutor(device, seed)
        calibration = calibrate(executor, executable.bit_qubits, parts=["readout"])
        parities = executor.expectation(on_device, x, theta)
        p = signed_sums(np.concatenate([np.ones((ROWS, 1)), parities], axis=1)) / 2**QUBITS
        outcomes = rng.multinomial(shots, np.clip(p, 0, None) / np.clip(p, 0, None).sum(1)[:, None])
        measured = signed_sums(outcomes) / shots
        numbers = [sum(1 << (QUBITS - 1 - q) for q in o) for o in executable.source.measured]
        undo = product_mitigation(calibration, executable, len(OBSERVABLES))
        estimates = {
            "none": measured[:, numbers[: len(OBSERVABLES)]],
            "ours": undo.apply(measured[:, numbers]),
            "true": with_true_matrices(undo, executable).apply(measured[:, numbers]),
        }
        if mthree is not None:
            mitigation = peer(calibration, executable)
            estimates["mthree"] = np.array([by_mthree(mitigation, row) for row in outcomes])
        for which, values in estimates.items():
            found[which].append(np.abs(values - ideal).mean(axis=0))
    return found


def by_mthree(mitigation, outcomes: np.ndarray) -> list[float]:  # type: ignore[no-untyped-def]
    """The observables from counts of outcomes; in mthree's words the last qubit comes first."""
    words = {
        f"{number:0{QUBITS}b}"[::-1]: int(count) for number, count in enumerate(outcomes) if count
    }
    quasi = mitigation.apply_correction(words, range(QUBITS))
    return [
        quasi.expval("".join("Z" if q in o else "I" for q in range(QUBITS))[::-1])
        for o in OBSERVABLES
    ]


def rows() -> list[Row]:
    found: list[Row] = []
    for shots in (1024, 8192):
        of_shots = errors(shots)
        for name, columns in (("<ZZ>", slice(0, 4)), ("<ZZZZ>", slice(4, 5))):
            by_seed = {
                which: np.array([v[columns].mean() for v in values])
                for which, values in of_shots.items()
                if values
            }
            means = ", ".join(f"{which} {v.mean():.5f}" for which, v in by_seed.items())
            what = f"{name} of 4 qubits on fake_lima, {shots} shots: mean error ({means}) to "
            for other, wanted in (("true", "<= 1.05"), ("mthree", "<= 1")):
                if other in by_seed:
                    ratios = (by_seed["ours"] / by_seed[other]).tolist()
                    words = "that with the true matrices" if other == "true" else other
                    found.append(spread(what + words, ratios, "times the error", wanted))
    return found


if __name__ == "__main__":
    show(rows, f"Products of Z after mitigation; calibrations of {CALIBRATION_SHOTS} shots.")
