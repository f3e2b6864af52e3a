"""Encoders: every function, gains and normalisation by hand, and refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from qcompile.errors import PolicyError
from qcompile.ir import Circuit, Program
from qcompile.policy import Encoder, Policy
from qcompile.policy.encoder import MOST_BIT
from qcompile.policy.surrogate import Surrogate, merged_inputs
from qcompile.simulate import Simulator

BY_HAND: dict[str, Callable[[float], float]] = {
    "arctan": math.atan,
    "tanh": math.tanh,
    "identity": float,
    "clip": lambda value: max(-1.0, min(1.0, value)),
}
FEATURE, SCALE = [2, 0, 2, 1, 0], [1.0, -0.5, 3.0, 0.25, 2.0]
FUNCTIONS = ("arctan", "clip", "identity", "arctan", "tanh")
GAIN, MEAN, STD = [1.0, -2.0, 0.5, 3.0, 0.0], [0.5, -1.0, 10.0], [2.0, 0.1, 4.0]
ROWS = [[0.1, 9.0, -2.0], [-4.0, 9.5, 0.25], [3.0, 0.0, 70.0]]


def encoder(function: Any = "arctan", feature: Any = FEATURE, scale: Any = SCALE,
            **more: list[float]) -> Encoder:  # fmt: skip
    arrays = {key: np.array(numbers) for key, numbers in more.items()}
    return Encoder(function, np.array(feature), np.array(scale, dtype=float), **arrays)


def policy_of(made: Encoder) -> Policy:
    """A circuit for each input, and numbers that are not zero."""
    count = len(made.feature)
    circuits = [Circuit.parse(f"h ry(x{i}) rz(x{(i + 1) % count}) ry(0.3)") for i in range(count)]
    weights = np.linspace(-1, 2, 2 * count).reshape(2, count)
    return Policy(
        "made", "any", made, Program.of(circuits, count), np.zeros(0), weights, np.ones(2)
    )


def test_every_input_has_its_own_function_gain_and_normalised_feature() -> None:
    found = policy_of(encoder(FUNCTIONS, gain=GAIN, mean=MEAN, std=STD)).encode(ROWS)
    for row, inputs in zip(ROWS, found, strict=True):
        for i, x in enumerate(inputs):
            f = FEATURE[i]
            value = BY_HAND[FUNCTIONS[i]](SCALE[i] * (row[f] - MEAN[f]) / STD[f])
            assert x == pytest.approx(GAIN[i] * value, rel=1e-14, abs=1e-300)


@pytest.mark.parametrize("function", BY_HAND)
def test_what_is_neutral_changes_no_bit(function: str) -> None:
    observations = np.random.default_rng(0).normal(size=(50, 3)) * 10
    plain = encoder(function)(observations)
    by_hand = observations[:, FEATURE] * np.array(SCALE)
    expected = {"arctan": np.arctan, "tanh": np.tanh}.get(function, lambda v: v)(by_hand)
    if function == "clip":
        expected = np.minimum(np.maximum(by_hand, -1), 1)
    neutral = encoder((function,) * 5, gain=[1.0] * 5, mean=[0.0] * 3, std=[1.0] * 3)
    for found in (plain, neutral(observations)):
        assert found.tobytes() == expected.tobytes()


def test_mean_and_std_may_be_given_alone() -> None:
    observations = np.array(ROWS)
    centred = (observations - MEAN)[:, FEATURE] * SCALE
    np.testing.assert_allclose(encoder("identity", mean=MEAN)(observations), centred, rtol=1e-15)
    divided = (observations / STD)[:, FEATURE] * SCALE
    np.testing.assert_allclose(encoder("identity", std=STD)(observations), divided, rtol=1e-15)


def test_bits_of_a_number_are_turned_by_pi() -> None:
    """13 is 1101, 2^52 + 6 has the bits 1, 2 and 52."""
    made = policy_of(encoder("bits", [0, 1, 2, 3, MOST_BIT], [1.0] * 5))
    found = made.encode([[13.0], [0.0], [2.0**52 + 6]])
    expected = [[1, 0, 1, 1, 0], [0, 0, 0, 0, 0], [0, 1, 1, 0, 1]]
    np.testing.assert_array_equal(found, np.pi * np.array(expected))
    assert made.encoder.features == 1
    half = encoder("bits", [1, 0], [1.0, 1.0], gain=[0.5, -1.0])
    np.testing.assert_array_equal(half(np.array([[3.0]])), [[np.pi / 2, -np.pi]])


@pytest.mark.parametrize("number", [1.5, -1.0, 2.0**53, np.nan, np.inf])
def test_bits_are_those_of_whole_numbers(number: float) -> None:
    with pytest.raises(PolicyError, match="bits needs observations that are whole numbers"):
        encoder("bits", [0], [1.0])(np.array([[number]]))


def test_an_observation_has_what_is_read_and_what_is_normalised() -> None:
    assert encoder().features == 3
    assert encoder(mean=[0.0] * 6, std=[1.0] * 6).features == 6


@pytest.mark.parametrize(
    "made",
    [
        encoder(FUNCTIONS, gain=GAIN, mean=MEAN, std=STD),
        encoder("clip", [0, 0, 0, 0], [2, -2, 2, 2], gain=[1.0, 1.0, -1.0, 0.5]),
        encoder(("tanh", "arctan", "tanh"), [1, 1, 1], [2, 2, -2], mean=[0.0, 0.7]),
    ],
)
def test_the_surrogate_knows_every_encoder(made: Encoder) -> None:
    policy, observations = policy_of(made), np.random.default_rng(1).normal(size=(30, 3))
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    found = Surrogate.of(policy).probabilities(observations)
    np.testing.assert_allclose(found, policy.probabilities(z), rtol=0, atol=1e-13)


def test_inputs_are_merged_where_all_but_the_sign_is_equal() -> None:
    made = encoder("clip", [0, 0, 0, 0, 0], [2, -2, 2, 2, 2], gain=[1.0, 1.0, -1.0, 0.5, 0.0])
    merged = [str(angle) for angle in merged_inputs(policy_of(made)).values()]
    assert merged == ["x0", "-x0", "-x0", "x3", "0.0"]


def test_formulas_are_what_is_computed() -> None:
    made = encoder(("arctan", "identity"), [1, 0], [2, 3], gain=[0.5, 1], mean=[0, 4], std=[1, 8])
    assert [made.formula(0), made.formula(1)] == [
        "0.5*arctan(2 * (observation[1] - 4) / 8)",
        "1*3 * (observation[0] - 0) / 1",
    ]
    assert encoder("tanh").formula(1) == "tanh(-0.5 * observation[0])"
    assert encoder("bits", [3], [1.0]).formula(0) == "pi*bit 3 of the observation"


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (encoder(("arctan", "tanh")), "encoder.function has 2 names.\n  It needs one or 5"),
        (encoder(("arctan",) * 4 + ("sin",)), "Unknown encoder function 'sin'"),
        (encoder(gain=[1.0]), r"encoder.gain has shape \(1,\)"),
        (encoder(gain=[np.nan] * 5), "encoder.gain contains a number that is not finite"),
        (encoder(gain=[1e10] * 5), "encoder.gain has an entry of 1e\\+10"),
        (encoder(mean=[0.0] * 2), "encoder.mean has 2 numbers.\n  It needs .* 3 or more"),
        (encoder(std=[1.0] * 2), "encoder.std has 2 numbers"),
        (
            encoder(mean=[0.0] * 3, std=[1.0] * 4),
            "encoder.mean has 3 numbers, but encoder.std has 4",
        ),
        (encoder(mean=[[0.0]] * 3), r"encoder.mean has shape \(3, 1\)"),
        (encoder(std=[1.0, 0.0, 1.0]), "encoder.std contains a number that is not positive"),
        (encoder(std=[1.0, 1.0, 1e-10]), "encoder.std contains a number that is too small"),
        (
            encoder(("bits",) * 4 + ("tanh",)),
            r"has bits and other functions\.\n  .*: use bits for all inputs\.",
        ),
        (encoder("bits"), "needs scale 1, and no mean or std"),
        (encoder("bits", scale=[1] * 5, mean=[0.0]), "needs scale 1, and no mean or std"),
        (encoder("bits", [53], [1.0]), "encoder.feature has an entry of 53.\n  .* at most 52"),
    ],
)
def test_what_is_no_encoder_is_refused(made: Encoder, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        policy_of(made)
