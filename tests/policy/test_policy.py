"""Policies: encoding, the head, sampling, parameter counts and refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from qcompile.errors import PolicyError
from qcompile.ir import Circuit, Program
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel, single

CIRCUITS, ACTIONS, REUSE = 3, 4, 5


def make(seed: int = 0, reuse: int = REUSE) -> Policy:
    rng = np.random.default_rng(seed)
    program, _ = parallel(CIRCUITS, 1)
    return Policy(
        "made",
        "CartPole-v1",
        Encoder("arctan", np.array([2, 0, 2]), np.array([1.0, -0.5, 3.0])),
        program,
        rng.normal(size=CIRCUITS),
        rng.normal(size=(ACTIONS, reuse * CIRCUITS)),
        rng.normal(size=ACTIONS),
        reuse,
    )


def paper(features: int, copies: int, actions: int, scale: float = 1.0) -> Policy:
    """A policy of the paper's size, its numbers zero."""
    program, feature = parallel(features, copies)
    return Policy(
        "paper",
        "any",
        Encoder("arctan", np.array(feature), np.full(len(feature), scale)),
        program,
        np.zeros(len(program.parameters)),
        np.zeros((actions, len(program))),
        np.zeros(actions),
    )


@pytest.mark.parametrize(
    ("function", "by_hand"),
    [("arctan", math.atan), ("tanh", math.tanh), ("identity", float)],
)
def test_an_input_is_the_function_of_a_scaled_feature(function: str, by_hand: object) -> None:
    policy = make()
    policy = replace(policy, encoder=replace(policy.encoder, function=function))
    observations = [[0.1, 9.0, -2.0], [-4.0, 9.0, 0.25]]
    expected = [
        [by_hand(row[2]), by_hand(-0.5 * row[0]), by_hand(3.0 * row[2])]  # type: ignore[operator]
        for row in observations
    ]
    np.testing.assert_allclose(policy.encode(observations), expected, rtol=1e-15)


def test_wider_observations_and_single_precision_are_taken() -> None:
    wide = np.array([[0.5, 7.0, -0.25, 99.0]], dtype=np.float32)
    x = make().encode(wide)
    assert x.dtype == np.float64
    np.testing.assert_array_equal(x, make().encode([[0.5, 7.0, -0.25]]))


def test_logits_follow_the_columns_copy_by_copy() -> None:
    """Column c * n + i is copy c of circuit i: copies side by side, as the paper's layer has it."""
    policy, z = make(), np.random.default_rng(1).uniform(-1, 1, (6, CIRCUITS))
    for row, logits, probabilities in zip(
        z, policy.logits(z), policy.probabilities(z), strict=True
    ):
        expected = []
        for action in range(ACTIONS):
            total = policy.bias[action]
            for copy in range(REUSE):
                for circuit in range(CIRCUITS):
                    column = copy * CIRCUITS + circuit
                    total += policy.weights[action, column] * row[circuit]
            expected.append(total)
        np.testing.assert_allclose(logits, expected, rtol=1e-12, atol=1e-14)
        odds = [math.exp(value) for value in expected]
        np.testing.assert_allclose(probabilities, np.array(odds) / sum(odds), rtol=1e-12)


def test_folding_keeps_the_probabilities() -> None:
    policy, z = make(), np.random.default_rng(2).uniform(-1, 1, (9, CIRCUITS))
    folded = policy.folded()
    assert (folded.reuse, folded.weights.shape) == (1, (ACTIONS, CIRCUITS))
    np.testing.assert_allclose(folded.probabilities(z), policy.probabilities(z), rtol=1e-14)
    by_hand = sum(policy.weights[1, copy * CIRCUITS + 2] for copy in range(REUSE))
    assert folded.weights[1, 2] == pytest.approx(by_hand, rel=1e-14)


def test_importance_is_what_an_error_costs_in_information() -> None:
    """A small error dz of one <Z> moves equal probabilities by importance dz^2 / 2 nats."""
    policy = make()
    z = np.random.default_rng(3).uniform(-1, 1, (1, CIRCUITS))
    even = replace(policy, bias=policy.bias - policy.logits(z)[0])
    np.testing.assert_allclose(even.probabilities(z), 1 / ACTIONS, rtol=1e-12)
    for circuit in range(CIRCUITS):
        error = 1e-3 * np.eye(CIRCUITS)[circuit]
        nats = -np.log(ACTIONS * even.probabilities(z + error)).mean()
        assert nats == pytest.approx(policy.importance[circuit] * 1e-6 / 2, rel=2e-2)


def test_what_all_actions_share_is_of_no_importance() -> None:
    policy = make()
    shifted = replace(policy, weights=policy.weights + np.arange(REUSE * CIRCUITS))
    np.testing.assert_allclose(shifted.importance, policy.importance, rtol=1e-12)
    np.testing.assert_array_equal(policy.folded().importance, policy.importance)
    only = replace(policy, weights=policy.weights[:1], bias=policy.bias[:1])
    np.testing.assert_array_equal(only.importance, 0.0)


def test_probabilities_survive_large_logits() -> None:
    policy = replace(make(), bias=np.array([1000.0, 0.0, -1000.0, 1000.0]))
    policy = replace(policy, weights=np.zeros_like(policy.weights))
    np.testing.assert_allclose(policy.probabilities(np.zeros((1, CIRCUITS))), [[0.5, 0, 0, 0.5]])


def test_actions_are_drawn_from_the_softmax() -> None:
    """Pearson's statistic of 40000 draws; a true law passes its bound but once in a million."""
    policy, draws = make(), 40_000
    z = np.array([[0.3, -0.8, 0.1]])
    odds = np.exp(policy.weights @ np.tile(z[0], REUSE) + policy.bias)
    expected = draws * odds / odds.sum()
    assert expected.min() > 5
    actions = policy.sample(np.repeat(z, draws, axis=0), np.random.default_rng(3))
    assert actions.shape == (draws,)
    found = np.bincount(actions, minlength=ACTIONS)
    assert ((found - expected) ** 2 / expected).sum() < chi2.isf(1e-6, ACTIONS - 1)


def test_rows_are_drawn_independently() -> None:
    policy = replace(make(), weights=np.zeros((ACTIONS, REUSE * CIRCUITS)), bias=np.zeros(ACTIONS))
    actions = policy.sample(np.zeros((20_000, CIRCUITS)), np.random.default_rng(4))
    pairs = np.bincount(actions[::2] * ACTIONS + actions[1::2], minlength=ACTIONS**2)
    expected = 10_000 / ACTIONS**2
    assert ((pairs - expected) ** 2 / expected).sum() < chi2.isf(1e-6, ACTIONS**2 - 1)


def test_the_same_generator_draws_the_same_actions() -> None:
    policy, z = make(), np.zeros((50, CIRCUITS))
    first, again, other = (policy.sample(z, np.random.default_rng(s)) for s in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def with_probabilities(*probabilities: float) -> Policy:
    """A policy with fixed action probabilities, whatever it measures."""
    bias = np.array([math.log(p) if p else -1e4 for p in probabilities])
    return replace(make(), bias=bias, weights=np.zeros((len(bias), REUSE * CIRCUITS)))


def test_a_number_decides_by_the_cumulative_probabilities() -> None:
    """Sums by hand: 0.1, 0.3, 0.6 and 1."""
    policy = with_probabilities(0.1, 0.2, 0.3, 0.4)
    u = np.array([0.0, 0.0999, 0.1001, 0.2999, 0.3001, 0.5999, 0.6001, 0.9999])
    assert policy.decide(np.zeros((8, CIRCUITS)), u).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


def test_every_row_is_decided_by_its_own_measurement() -> None:
    policy, rng = make(), np.random.default_rng(8)
    z, u = rng.uniform(-1, 1, (300, CIRCUITS)), rng.random(300)
    expected = []
    for row, number in zip(policy.probabilities(z).tolist(), u.tolist(), strict=True):
        total, action = row[0], 0
        while total <= number:
            action += 1
            total += row[action]
        expected.append(action)
    assert len(set(expected)) == ACTIONS
    assert policy.decide(z, u).tolist() == expected


def test_an_impossible_action_is_not_taken() -> None:
    policy = with_probabilities(0.0, 0.5, 0.0, 0.5)
    u = np.array([0.0, 0.25, 0.75, np.nextafter(1, 0)])
    assert policy.decide(np.zeros((4, CIRCUITS)), u).tolist() == [1, 1, 3, 3]


def test_the_last_action_is_taken_where_the_sum_stays_below() -> None:
    """0.1, added ten times, is the largest number below 1."""
    last = np.nextafter(1, 0)
    assert np.full(10, 0.1).cumsum()[-1] <= last
    policy = with_probabilities(*[0.1] * 10)
    assert policy.decide(np.zeros((1, CIRCUITS)), np.array([last])).tolist() == [9]


def test_a_sample_is_a_decision_by_uniform_numbers() -> None:
    policy, z = make(), np.random.default_rng(9).uniform(-1, 1, (70, CIRCUITS))
    u = np.random.default_rng(10).random(70)
    expected = policy.decide(z, u)
    np.testing.assert_array_equal(policy.sample(z, np.random.default_rng(10)), expected)


@pytest.mark.parametrize("shape", [(2,), (3, 1), ()])
def test_there_is_a_number_for_each_row(shape: tuple[int, ...]) -> None:
    with pytest.raises(PolicyError, match=r"u has shape .*\n  It needs \(3,\)"):
        make().decide(np.zeros((3, CIRCUITS)), np.zeros(shape))


def test_greedy_takes_the_most_probable_action() -> None:
    policy, z = make(), np.random.default_rng(7).uniform(-1, 1, (40, CIRCUITS))
    expected = [row.index(max(row)) for row in policy.probabilities(z).tolist()]
    assert len(set(expected)) > 1
    assert policy.greedy(z).tolist() == expected


@pytest.mark.parametrize(
    ("policy", "count"),
    [
        (paper(4, 1, 2), 4 + 4 * 2 + 2),  # CartPole: four circuits
        (paper(6, 1, 3), 6 + 21),  # Acrobot on the devices
        (paper(8, 3, 4), 24 + 100),  # LunarLander on the devices
        (paper(8, 3, 4, scale=2.0), 24 + 24 + 100),  # input scales count where they are used
    ],
)
def test_parameters_of_the_paper(policy: Policy, count: int) -> None:
    assert policy.parameter_count == count


def test_the_device_circuit_has_five_parameters() -> None:
    program, feature = single(4, 1)
    encoder = Encoder("arctan", np.array(feature), np.ones(3))
    policy = Policy(
        "a", "CartPole-v0", encoder, program, np.zeros(1), np.zeros((2, 1)), np.zeros(2)
    )
    assert policy.parameter_count == 1 + 4


def test_output_reuse_does_not_count() -> None:
    """Copies fold away: 3 theta, 3 input scales, and 4 actions of 3 weights and a bias."""
    assert make(reuse=7).parameter_count == 3 + 3 + 4 * 4


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("theta", np.zeros(2), r"theta has shape \(2,\)\.\n  It needs \(3,\)"),
        ("theta", np.zeros((3, 1)), r"theta has shape \(3, 1\)"),
        (
            "weights",
            np.zeros((ACTIONS, 14)),
            r"weights has shape \(4, 14\)\.\n  It needs \(4, 15\)",
        ),
        ("weights", np.zeros((15, ACTIONS)), "weights has shape"),
        ("bias", np.zeros(3), "weights has shape"),
        ("reuse", 1, "weights has shape"),
        ("theta", np.array([0, np.nan, 0]), "theta contains a number that is not finite"),
        ("hold", 0, "hold is 0"),
        ("bias", np.array([0, np.inf, 0, 0]), "bias contains a number that is not finite"),
        ("encoder", Encoder("sin", np.arange(3), np.ones(3)), "Unknown encoder function 'sin'"),
        ("encoder", Encoder("arctan", np.arange(2), np.ones(3)), r"encoder.feature has shape \(2,"),
        ("encoder", Encoder("arctan", np.arange(3), np.ones(4)), r"encoder.scale has shape \(4,"),
        ("encoder", Encoder("arctan", np.arange(3), np.full(3, np.nan)), "encoder.scale contains"),
    ],
)
def test_what_does_not_fit_is_refused(name: str, array: object, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        replace(make(), **{name: array})


def test_a_policy_has_circuits_and_actions() -> None:
    encoder = Encoder("arctan", np.zeros(0, dtype=int), np.zeros(0))
    with pytest.raises(PolicyError, match="0 circuits and 2 actions"):
        Policy("p", "e", encoder, Program(()), np.zeros(0), np.zeros((2, 0)), np.zeros(2))
    program = Program((Circuit(),))
    with pytest.raises(PolicyError, match="1 circuits and 0 actions"):
        Policy("p", "e", encoder, program, np.zeros(0), np.zeros((0, 1)), np.zeros(0))


@pytest.mark.parametrize("shape", [(2, 2), (3,), (1, 1, 3)])
def test_observations_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(PolicyError, match=r"'made' needs \(B, 3\) or wider"):
        make().encode(np.zeros(shape))
