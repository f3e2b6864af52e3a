"""Fits that contradict their counts: rare without crosstalk, and found where there is crosstalk."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from noisy import Neighbours
from scipy.stats import binom, chi2

from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate, misfits, response_mitigation
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.mitigation.misfit import MISFIT_LEVEL, misfit_warnings, p_values
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

TORONTO = load_device("fake_toronto")
QUBITS = np.arange(27)


def live(executor: OfflineExecutor | Neighbours) -> Calibration:
    return calibrate(executor, QUBITS, 8192, parts=["response"], angles_rad=LIVE_ANGLES_RAD)  # type: ignore[arg-type]


def test_a_clean_calibration_is_seldom_doubted() -> None:
    runs = 20
    made = [calibrate(OfflineExecutor(TORONTO, seed), QUBITS, 1024) for seed in range(runs)]
    assert sum(bool(misfits(c)) for c in made) <= binom.isf(1e-6, runs, MISFIT_LEVEL)


@pytest.mark.parametrize("share", [0.1, 0.2])
def test_bits_read_from_a_neighbour_are_found(share: float) -> None:
    """On both sides of every pair; qubit 26 has none. All turned alike, nothing shows.

    A tenth of qubit 14's bits is found two times in three only: its curve and its neighbour's are
    nearly the same there.
    """
    found = {misfit.qubit for misfit in misfits(live(Neighbours(TORONTO, share, 0)))}
    assert found | ({14} if share == 0.1 else set()) == set(range(26))
    alike = np.repeat(LIVE_ANGLES_RAD[:, None], 27, axis=1)
    machine = Neighbours(TORONTO, share, 0)
    blind = calibrate(machine, QUBITS, 8192, parts=["response"], angles_rad=alike)  # type: ignore[arg-type]
    assert not misfits(blind)


def test_the_readout_finds_neighbours_too() -> None:
    made = calibrate(Neighbours(TORONTO, 0.1, 0), QUBITS, 8192, parts=["readout"])  # type: ignore[arg-type]
    assert {misfit.qubit for misfit in misfits(made)} == set(range(26))


def doubtful(made: Callable[..., Calibration], chi_square: list[float]) -> Calibration:
    calibration = made(curves=[[0.0, -0.9, 0.05]] * 3, error=0.004)
    assert calibration.response is not None
    response = calibration.response.model_copy(update={"chi_square": tuple(chi_square)})
    return calibration.model_copy(update={"response": response})


def test_the_level_is_divided_among_the_fits(made: Callable[..., Calibration]) -> None:
    """Three fits with five degrees of freedom: 0.001 / 3 each."""
    border = chi2.isf(MISFIT_LEVEL / 3, 5)
    calibration = doubtful(made, [border - 0.1, border + 0.1, 200.0])
    found = misfits(calibration)
    assert [(misfit.qubit, misfit.part, misfit.degrees) for misfit in found] == [
        (1, "response", 5),
        (2, "response", 5),
    ]
    assert found[0].p_value == pytest.approx(chi2.sf(border + 0.1, 5))
    assert [misfit.qubit for misfit in misfits(calibration, qubits=[0, 2])] == [2]
    assert misfits(calibration, ["readout"]) == []
    assert calibration.response is not None
    none = calibration.response.model_copy(update={"degrees_of_freedom": 0})
    np.testing.assert_array_equal(p_values(none), 1)


def test_the_level_is_divided_among_both_parts(made: Callable[..., Calibration]) -> None:
    """Six fits with five degrees of freedom: 0.001 / 6 each."""
    border = chi2.isf(MISFIT_LEVEL / 6, 5)
    calibration = doubtful(made, [border - 0.1, border + 0.1, 1.0])
    both = made(readout=([0.01] * 3, [0.02] * 3), curves=[[0.0, -0.9, 0.05]] * 3)
    assert both.readout is not None
    chi_square = (1.0, border - 0.1, border + 0.1)
    readout = both.readout.model_copy(update={"chi_square": chi_square, "degrees_of_freedom": 5})
    found = misfits(calibration.model_copy(update={"readout": readout}))
    assert [(misfit.qubit, misfit.part) for misfit in found] == [(2, "readout"), (1, "response")]


def test_a_warning_names_the_qubits_and_a_remedy(made: Callable[..., Calibration]) -> None:
    found = misfits(doubtful(made, [1.0, 100.0, 100.0]))
    (words,) = misfit_warnings(found)
    assert words.startswith("The response of qubit 1, 2 does not depend on its own angle alone")
    assert "Use other qubits, with an unused one between neighbours" in words
    assert "--parts readout,response" in words
    assert misfit_warnings([misfit.values() for misfit in found]) == [words]


def test_a_tilt_that_a_misfit_makes_is_left(made: Callable[..., Calibration]) -> None:
    """0.055 rad are 12 errors, and fewer than three where counts scatter 8 times as much."""
    calibration = doubtful(made, [5.0, 5.0 * 64, 5.0])
    executable = compile(parallel(3, 1)[0], calibration.device)
    mitigation = response_mitigation(calibration, executable)
    tilt = mitigation.tilt[np.argsort(executable.qubits)]
    assert tilt[0] == tilt[2] != 0
    assert tilt[1] == 0
    covariance = mitigation.covariance[np.argsort(executable.qubits)]
    np.testing.assert_allclose(covariance[1], 64 * covariance[0])
