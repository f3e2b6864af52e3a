"""The shots of a calibration against a closed form, and the error that remains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from qcompile.device import Coupling, Device, Qubit
from qcompile.execution import OfflineExecutor
from qcompile.ir import Circuit, Program
from qcompile.mitigation import (
    calibrate,
    enough_product_shots,
    enough_shots,
    readout_mitigation,
)
from qcompile.mitigation.enough import MIN_SHOTS, SHARE
from qcompile.mitigation.products import with_sub_products
from qcompile.passes import Executable, compile

P = 0.1


def placed(copies: int = 1) -> Executable:
    """Four circuits on 4 `copies` qubits, of readout error P and perfect gates."""
    qubit = Qubit(t1_us=1e9, t2_us=1e9, p10=P, p01=P)
    device = Device(
        name="even", source="made", basis_gates=("rz", "sx", "x"), qubits=(qubit,) * 4 * copies
    )
    program = Program.of([Circuit.parse(f"ry(x{i})") for i in range(4)], 4, 0)
    return compile(program, device, copies=copies)


def by_hand(shots: float, qubits: int, average: int = 1) -> int:
    """The least power of two for which the calibration's variance is SHARE of the shot noise's.

    With v = P (1 - P) / N the error of z has the variance ((1 - z)^2 + (1 + z)^2) v / c^2, of mean
    8 v / 3 / c^2 over z in [-1, 1], c = 1 - 2 P; shot noise (1 - c^2 z^2) / shots / c^2 has the
    mean (1 - c^2 / 3) / shots / c^2. N are the preparations of a bit: 1 + ceil(log2 qubits) for
    each shot of the calibration. In a mean over places both become smaller alike, and each place
    has a share of the shots.
    """
    c = 1 - 2 * P
    wanted = shots * 8 / 3 * P * (1 - P) / (1 - c**2 / 3) / SHARE / average
    return 2 ** int(np.ceil(np.log2(wanted / (1 + np.ceil(np.log2(qubits))))))


@pytest.mark.parametrize("shots", [300, 1200])
def test_the_shots_are_those_of_the_closed_form(shots: int) -> None:
    assert enough_shots(placed(), "readout", shots, np.ones(4)) == by_hand(shots, 4)
    assert MIN_SHOTS < by_hand(300, 4) < by_hand(1200, 4) < 8192


def test_a_mean_over_places_needs_fewer() -> None:
    """4,800 shots on each of four places are 4,800 / 4 to a place: errors average as well."""
    shots, weights = np.full(16, 1200), np.full(16, 1 / 16)
    split = enough_shots(placed(4), "readout", shots, weights)
    assert split == by_hand(4800, 16, average=4) == by_hand(1200, 16)
    assert split < by_hand(4800, 16) == enough_shots(placed(4), "readout", 4800, np.ones(16))


def test_few_shots_ask_for_the_least_and_many_for_the_usual() -> None:
    found = [enough_shots(placed(), "readout", shots, np.ones(4)) for shots in (1, 16, 100_000)]
    assert found == [MIN_SHOTS, MIN_SHOTS, 8192]
    assert enough_shots(placed(), "readout", 1024, np.zeros(4)) == MIN_SHOTS


def test_circuits_that_matter_to_nothing_do_not_count() -> None:
    """On a device with one bad qubit, of a circuit that the policy does not read."""
    good, bad = placed().device.qubits[0], Qubit(t1_us=1e9, t2_us=1e9, p10=0.001, p01=0.001)
    device = placed().device.model_copy(update={"qubits": (bad, bad, bad, good)})
    executable = compile(placed().source, device, importance=np.array([0.0, 1.0, 1.0, 1.0]))
    assert executable.qubits[0] == 3
    some, all_ = (
        enough_shots(executable, "readout", 4096, importance)
        for importance in (np.array([0.0, 1.0, 1.0, 1.0]), np.ones(4))
    )
    assert some < all_


def test_a_response_needs_more_than_a_readout() -> None:
    """Its angles are measured once or twice, each prepared bit three times of four qubits."""
    readout, response = (
        enough_shots(placed(), part, 300, np.ones(4)) for part in ("readout", "response")
    )
    assert readout < response <= 8192


def test_enough_shots_leave_the_stated_share_of_the_error() -> None:
    """300 calibrations of the shots found, at z = 0: the error of z is within SHARE of shot noise.

    Their variance, of 4 x 300 numbers, is known to 4 %.
    """
    executable, shots = placed(), 1200
    enough = enough_shots(executable, "readout", shots, np.ones(4))
    zs = []
    for seed in range(300):
        known = calibrate(
            OfflineExecutor(executable.device, seed), range(4), enough, parts=["readout"]
        )
        zs.append(readout_mitigation(known, executable).apply(np.zeros((1, 4)))[0])
    error, noise = np.var(zs), 1 / shots / (1 - 2 * P) ** 2
    preparations = enough * 3
    expected = 2 * P * (1 - P) / preparations / (1 - 2 * P) ** 2
    assert error == pytest.approx(expected, rel=0.2)
    assert error < SHARE * noise


def products(copies: int = 1) -> Executable:
    """<ZZ> of two qubits on 2 `copies` qubits as above, with perfect couplings between all."""
    qubit = Qubit(t1_us=1e9, t2_us=1e9, p10=P, p01=P)
    pairs = [(a, b) for a in range(2 * copies) for b in range(2 * copies) if a != b]
    device = Device(
        format="qcompile-device-2",
        name="even",
        source="made",
        basis_gates=("rz", "sx", "x"),
        qubits=(qubit,) * 2 * copies,
        couplings=tuple(Coupling(gate="cx", qubits=on, error=0, length_ns=0) for on in pairs),
    )
    pair = Program.of([Circuit.parse("ry(x0)@0 cx@0,1 ry(x1)@1", 2)], 2, 0)
    program = with_sub_products(replace(pair, observables=((0, 1),)))
    return compile(program, device, copies=copies)


def products_by_hand(shots: float, qubits: int) -> int:
    """As above: <ZZ> = z w is measured as c^2 z w, and z^2 has the mean 1/3, as w^2.

    The calibration's variance is 2 v / c^2 (w^2 + (z w)^2) for one bit and the same for the other,
    of mean 16 v / 9 / c^2; that of the shot noise (1 - c^4 z^2 w^2) / shots / c^4.
    """
    c = 1 - 2 * P
    wanted = shots * 16 / 9 * P * (1 - P) * c**2 / (1 - c**4 / 9) / SHARE
    return 2 ** int(np.ceil(np.log2(wanted / (1 + np.ceil(np.log2(qubits))))))


@pytest.mark.parametrize("shots", [500, 1000, 2000])
def test_the_shots_for_products_are_those_of_the_closed_form(shots: int) -> None:
    one = enough_product_shots(products(), 1, np.array([shots]), np.ones(1))
    assert one == products_by_hand(shots, 2)
    two = enough_product_shots(products(2), 1, np.full(2, shots), np.ones(2))
    assert two == products_by_hand(shots, 4)
    assert MIN_SHOTS < products_by_hand(500, 4) < products_by_hand(2000, 2) < 8192


def test_products_of_one_bit_need_what_single_circuits_need() -> None:
    """The same four circuits, their observables listed in another order."""
    other = replace(placed().source, observables=((1,), (0,), (2,), (3,)))
    executable = compile(other, placed().device)
    found = enough_product_shots(executable, 4, np.array([700]), np.ones(4))
    assert found == enough_shots(placed(), "readout", 700, np.ones(4))
