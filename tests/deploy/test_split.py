"""The shots of a row over several copies: counts, mitigation, costs and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from qcompile.arrays import CountArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.measurement import Measurement
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.device import Device, Qubit, load_device
from qcompile.errors import CountsError, OptionError
from qcompile.execution import OfflineExecutor
from qcompile.execution.prepared import Prepared
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.policy import load_policy
from qcompile.policy.layouts import parallel
from qcompile.streams import Draws

PROGRAM, _ = parallel(3, 1)
THETA = np.array([0.3, -1.2, 2.0])
NOTHING = np.zeros(0)


def qubit(p10: float, p01: float) -> Qubit:
    return Qubit(t1_us=1e9, t2_us=1e9, p10=p10, p01=p01)


def device(*qubits: Qubit) -> Device:
    return Device(name="mine", source="by hand", basis_gates=("rz", "sx", "x"), qubits=qubits)


def measurement(program: Program, on: Device, **changes: Any) -> Measurement:
    """Split, mitigated by an exact calibration of the readout."""
    executor = OfflineExecutor(on, 0)
    known = calibrate(executor, range(len(on.qubits)), None, parts=["readout"])
    chosen = {"calibration": known, "mitigation": "readout", "split": True, **changes}
    return Measurement(program, executor, RunSettings(**chosen).resolved(on))


class _Counted(Prepared):
    """Known counts, and a record of the requests."""

    def __init__(self, ones: list[list[int]]):
        self.counts = np.array(ones)

    def ones(self, x: Any, theta: Any, shots: Any, rng: Any = None) -> CountArray:
        self.inputs, self.shots = x, shots
        return self.counts


def test_the_mean_of_places_by_hand() -> None:
    """Five shots over two qubits: 1 of 3 ones and 2 of 2, each place undone, weighted 3 to 2.

    (1 - 2/3 - 0.1) / 0.9 = 7/27 and (-1 - 0.05) / 0.85 = -21/17, which is clipped in the mean
    alone; in the second row that mean itself is clipped: (1 - 0.1) / 0.9 and (1 - 0.05) / 0.85.
    """
    measure = measurement(
        Program.of([Circuit.parse("ry(x0)")], 1, 0),
        device(qubit(0.05, 0.1), qubit(0.0, 0.1)),
        shots=5,
    )
    assert (measure.settings.copies, measure.settings.place_shots.tolist()) == (2, [3, 2])
    assert measure.executable.qubits.tolist() == [1, 0]  # the better one first
    measure._prepared = counted = _Counted([[1, 2], [0, 0]])
    z = measure(np.array([[0.25], [0.5]]), NOTHING)
    np.testing.assert_allclose(z, [[0.6 * 7 / 27 - 0.4 * 21 / 17], [1.0]], atol=1e-12)
    np.testing.assert_array_equal(counted.inputs, [[0.25, 0.25], [0.5, 0.5]])
    np.testing.assert_array_equal(counted.shots, [3, 2])


def test_the_mean_is_that_of_the_exact_places() -> None:
    """3,000 rows of 20 shots over 6 places of fake_fez, whose gates add errors of their own.

    Expected is the mean over the places of exact expectations, each undone with its own readout,
    weighted by shots; its scatter is that of binomial counts: variance (1 - z^2) / n / contrast^2
    of a place of n shots. <Z> stays away from +-1, where the mean is clipped.
    """
    fez, rows, x = load_device("fake_fez"), 3000, np.array([[0.2, 0.9, 0.8]])
    measure = measurement(PROGRAM, fez, shots=20, copies=6)
    z = measure(np.repeat(x, rows, 0), THETA, Rows.of(rows), Draws(1, 18))
    executable = measure.executable
    seen = OfflineExecutor(fez).expectation(executable, np.tile(x, (1, 6)), THETA).reshape(6, 3)
    places = [[fez.qubits[q] for q in part] for part in executable.qubits.reshape(6, 3)]
    # |1> is prepared by a pulse: its error counts as readout error.
    p10 = np.array([[q.p10 for q in part] for part in places])
    p01 = np.array([[q.p01 + _lost(q) * q.contrast for q in part] for part in places])
    contrast = 1 - p01 - p10
    shots = np.array([4, 4, 3, 3, 3, 3])[:, None]
    expected = (shots * (seen - (p01 - p10)) / contrast).sum(axis=0) / 20
    assert (np.abs(expected) < 0.8).all()
    variance = (shots * (1 - seen**2) / contrast**2).sum(axis=0) / 20**2
    assert (np.abs(z.mean(axis=0) - expected) < 5 * np.sqrt(variance / rows)).all()
    # A fourth moment of 3 gives the variance of a variance; binomial ones have less.
    assert (np.abs(z.var(axis=0) / variance - 1) < 5 * np.sqrt(2 / rows)).all()
    exact = measurement(PROGRAM, fez, shots=None, copies=6)(x, THETA)
    np.testing.assert_allclose(exact[0], ((seen - (p01 - p10)) / contrast).mean(axis=0), atol=1e-12)


def _lost(of: Qubit) -> float:
    """P(0) after an x on |0>: (1 - r) / 2 with r the <Z> that the channel leaves, by hand."""
    gate = of.gates["x"]
    t1, t2 = 1e3 * of.t1_us, 1e3 * min(of.t2_us, 2 * of.t1_us)
    along, across = np.exp(-gate.length_ns / t1), np.exp(-gate.length_ns / t2)
    relaxed = (3 - along - 2 * across) / 6
    left = 1 - max(2 * (gate.error - relaxed) / (1 - 2 * relaxed), 0.0)
    return float((1 - left * along + (1 - along)) / 2)


def test_places_draw_independently() -> None:
    """Four places of one circuit at p = 1/2: 4 x 500 counts of 8 shots, uncorrelated."""
    draws, rows = Draws(3, 4), Rows.of(500)
    source = draws.rows(rows.episode, rows.decision)
    counts = source.binomial(np.full(4, 8), np.full((500, 4), 0.5))
    correlation = np.corrcoef(counts.T)[np.triu_indices(4, 1)]
    assert np.abs(correlation).max() < 5 / np.sqrt(500)


def test_a_row_takes_the_shots_of_its_fullest_place() -> None:
    """Two episodes of three steps of cartpole_1q, 10 shots over 4 places: 3 shots an execution."""
    player = Deployment(
        load_policy("cartpole_1q"),
        "ibm_lima",
        shots=10,
        copies=4,
        split=True,
        max_steps=3,
        calibration_shots=100,
    )
    run = play(player, 2)
    assert (run.load.jobs, run.load.executions) == (3, 2 * 3 * 3)
    summary = run.summary()
    # Readout of four qubits: 2 + 2 * 2 patterns.
    assert (summary["jobs"], summary["executions"]) == (4, 18 + 6 * 100)
    known = {"shots": 10, "copies": 4, "split": True, "calibration_shots": 100}
    assert {name: summary[name] for name in known} == known


def test_rows_that_are_measured_ahead_change_nothing() -> None:
    found = []
    for depth in (1, 8, "auto"):
        settings = {"shots": 15, "split": True, "max_steps": 25, "speculate": depth}
        run = play(Deployment(load_policy("cartpole"), "fake_toronto", **settings), 3)
        found.append((run.episodes, run.load.jobs))
    assert found[0][0] == found[1][0] == found[2][0]
    assert found[1][1] < found[0][1] / 2


@pytest.mark.parametrize(("shots", "copies"), [(1024, 6), (6, 6), (5, 5), (2, 2)])
def test_a_row_takes_all_places_that_have_a_shot(shots: int, copies: int) -> None:
    """Of lunarlander's 24 circuits 6 copies fit on 155 qubits."""
    chosen = {"shots": shots, "split": True, "mitigation": "none"}
    player = Deployment(load_policy("lunarlander"), "fake_fez", **chosen)
    assert (player.settings.copies, player.settings.place_shots.sum()) == (copies, shots)
    assert player.settings.place_shots.min() >= 1


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"copies": 1}, OptionError, "over several copies; copies is 1"),
        ({"copies": 9, "shots": 8}, OptionError, "8 shots cannot be split over 9 copies"),
        ({"shots": 1}, OptionError, "fit on the device once, and a row has 1 shot"),
        ({"shots": 0}, CountsError, "0 shots cannot be run"),
        ({}, OptionError, "nothing to split over: the circuits fit on the device once"),
        ({"split": False, "calibration_shots": 0}, CountsError, "0 shots cannot be run"),
    ],
)
def test_what_cannot_be_split(changes: dict[str, Any], error: type[Exception], words: str) -> None:
    """On five qubits four circuits fit once."""
    with pytest.raises(error, match=words):
        Deployment(load_policy("cartpole"), "ibm_lima", **{"split": True, **changes})
