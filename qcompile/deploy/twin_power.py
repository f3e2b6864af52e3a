"""The power of a twin check to detect a changed readout, and the measurements it needs.

Raising p01 = P(0 | 1) by `effect` moves the `<Z>` of its qubit by effect (1 - u), where u = cos(w -
tilt) is the `<Z>` before readout: a move of its curve's (b, c, s). The chi-square of `check_twin`
then has the noncentrality v' (A^-1 + C)^-1 v = v' A (1 + C A)^-1 v, where v is that move, A the
information of the shots and C the covariance of the calibrated curve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.execution import TwinExecutor
from qcompile.limits import MAX_SHOTS
from qcompile.mitigation import CALIBRATION_SHOTS
from qcompile.mitigation.drift import DRIFT_LEVEL
from qcompile.mitigation.polar import polar_curves
from qcompile.passes import Executable, compile
from qcompile.policy import Policy
from qcompile.policy.policy import NO_THETA

EFFECT = 0.05
"""The default increase of a qubit's p01 that validation should detect."""
POWER = 0.9
"""The default probability of detecting it on any one qubit."""
_MIN_ROWS, _MAX_ROWS = 4, 16
_MIN_SHOTS = 256
_MAX_SHOTS = 4
"""A multiple of the calibration's shots, beyond which its own errors dominate."""
_MAX_EXECUTIONS = 60_000
"""Executions of a round, 21 seconds; more are never chosen automatically."""
_WITHIN_REACH = 0.95


def twin_program(calibration: Calibration, policy: Policy) -> tuple[TwinExecutor, Executable]:
    """The twin, and the policy compiled for it at level 2.

    Raises:
        CalibrationError: the calibration has no response curves, or too few qubits.
    """
    twin = TwinExecutor(calibration)
    return twin, compile(policy.trained_program, twin.device, 2, policy.importance)


@dataclass(frozen=True, eq=False)
class TwinPrediction:
    """A twin's prediction for a policy's circuits, one row per observation.

    `expected` (rows, circuits) are the `<Z>`; `design` (rows, circuits, 3) is (1, cos a, sin a) of
    their angles. `qubits` are the circuits' qubits, each once; circuit i is on qubits[qubit_of[i]].
    `covariance` (qubits, 3, 3) belongs to the curves; `moves` (qubits, 3) is the change of (b, c,
    s) when p01 is raised by 1.
    """

    expected: FloatArray
    design: FloatArray
    qubits: IntArray
    qubit_of: IntArray
    covariance: FloatArray
    moves: FloatArray

    @classmethod
    def of(
        cls, calibration: Calibration, policy: Policy, observations: FloatArray
    ) -> TwinPrediction:
        """The prediction for the policy's circuits and observations (rows, features).

        Raises:
            CalibrationError: the calibration or a circuit has no response curve.
        """
        twin, executable = twin_program(calibration, policy)
        _check_curves(executable)
        fit = calibration.response
        assert fit is not None  # the twin has curves
        x = policy.encode(observations)
        angles = executable.bind(x, NO_THETA)
        qubits, qubit_of = np.unique(executable.qubits, return_inverse=True)
        rows = calibration.rows(qubits)
        contrast = polar_curves(fit, executable.device.native).contrast[rows]
        moves = -np.array(fit.curves)[rows] / contrast[:, None]
        moves[:, 0] = 1.0
        return cls(
            expected=twin.expectation(executable, x, NO_THETA),
            design=np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=-1),
            qubits=qubits,
            qubit_of=qubit_of,
            covariance=np.array(fit.covariance)[rows],
            moves=moves,
        )

    def variance(self, shots: int) -> FloatArray:
        """The shot-noise variance of each `<Z>`, (rows, circuits)."""
        return np.asarray(np.maximum(1.0 - self.expected**2, 1.0 / shots) / shots)

    def powers(self, shots: int, effect: float) -> FloatArray:
        """The power for `effect` of a check with the first 1, 2, ... rows, (rows, qubits)."""
        from scipy.stats import chi2, ncx2

        weighted = self.design / self.variance(shots)[..., None]
        of_circuits = np.einsum("rci,rcj->rcij", weighted, self.design)
        information = self._sum_by_qubit(of_circuits).cumsum(axis=0)
        precision = information @ np.linalg.inv(np.eye(3) + self.covariance @ information)
        noncentrality = effect**2 * np.einsum("qi,rqij,qj->rq", self.moves, precision, self.moves)
        rows = np.arange(1, len(self.expected) + 1)[:, None]
        degrees = rows * np.bincount(self.qubit_of)
        critical = chi2.isf(DRIFT_LEVEL / len(self.qubits), degrees)
        return np.asarray(ncx2.sf(critical, degrees, np.maximum(noncentrality, 0.0)))

    def visibility(self) -> FloatArray:
        """How well each row shows a raised p01, (rows, qubits): chi-square of one shot."""
        moves = np.einsum("rci,ci->rc", self.design, self.moves[self.qubit_of])
        return self._sum_by_qubit(moves**2 / np.maximum(1.0 - self.expected**2, 1e-3))

    def _sum_by_qubit(self, of_circuits: FloatArray) -> FloatArray:
        """(rows, circuits, ...) summed over the circuits of each qubit."""
        qubits = range(len(self.qubits))
        return np.stack([of_circuits[:, self.qubit_of == q].sum(axis=1) for q in qubits], axis=1)


def choose_rows(visibility: FloatArray, rows: int) -> IntArray:
    """The rows of `visibility` (n, qubits) that cover all qubits best, chosen greedily.

    No row is repeated before all are used.
    """
    chosen: list[int] = []
    total, free = np.zeros(visibility.shape[1]), np.ones(len(visibility), dtype=bool)
    for _ in range(rows):
        gain = np.log(total + visibility + 1e-3).sum(axis=1)
        chosen.append(int(np.where(free, gain, -np.inf).argmax()))
        total = total + visibility[chosen[-1]]
        free[chosen[-1]] = False
        if not free.any():
            free[:] = True
    return np.array(chosen)


def choose_check(
    calibration: Calibration,
    policy: Policy,
    candidates: FloatArray,
    *,
    rows: int | None = None,
    shots: int | None = None,
    power: float = POWER,
    effect: float = EFFECT,
) -> tuple[FloatArray, int, float]:
    """Choose observations (rows, features) from `candidates`, and shots, that detect `effect`.

    They reach `power` on every qubit with the fewest executions; given rows or shots are kept. If
    _MAX_EXECUTIONS or the calibration's own errors rule out that power, they come close to the
    most possible. The third value is their power on the qubit where it is smallest.

    Raises:
        CalibrationError: the calibration or a circuit has no response curve.
    """
    visibility = TwinPrediction.of(calibration, policy, candidates).visibility()
    order = choose_rows(visibility, rows or min(_MAX_ROWS, len(candidates)))
    prediction = TwinPrediction.of(calibration, policy, candidates[order])
    fewest = min(_MIN_ROWS, len(order)) if rows is None else rows
    row_counts = np.arange(fewest, len(order) + 1)
    shot_counts = np.array([shots]) if shots is not None else _shot_counts(calibration)
    executions = shot_counts[:, None] * row_counts
    powers = np.array([prediction.powers(int(n), effect).min(axis=1) for n in shot_counts])
    affordable = executions <= max(_MAX_EXECUTIONS, executions.min())
    powers = np.where(affordable, powers[:, row_counts - 1], -1.0)
    most = float(powers.max())
    enough = powers >= (power if most >= power else _WITHIN_REACH * most)
    cheapest = np.where(enough, executions, np.inf).argmin()
    i, j = np.unravel_index(cheapest, powers.shape)
    return candidates[order[: row_counts[j]]], int(shot_counts[i]), float(powers[i, j])


def _shot_counts(calibration: Calibration) -> IntArray:
    """The numbers of shots to choose from, each a tenth more than the last."""
    counts = calibration.response_counts
    measured = CALIBRATION_SHOTS if counts is None or counts.shots is None else counts.shots
    most = max(min(_MAX_SHOTS * measured, MAX_SHOTS), _MIN_SHOTS)
    return np.unique(np.ceil(np.geomspace(_MIN_SHOTS, most, 60) / 16).astype(int) * 16)


def _check_curves(executable: Executable) -> None:
    for index, gates in enumerate(executable.gate_counts()):
        if not (gates["rz"] or gates["rx"]):
            raise CalibrationError(
                f"Circuit {index} has no rotation, so it has no response curve.",
                "Validate with a different policy.",
            )
