"""The surrogate: the paper's closed form, Qiskit's statevector, and its distinct functions."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.quantum_info import Operator, Statevector

from qcompile.errors import PolicyError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.policy import ENCODINGS, Encoder, Policy, load_policy, policy_names
from qcompile.policy.layouts import LAYOUTS, parallel, serial
from qcompile.policy.surrogate import Surrogate
from qcompile.simulate import Simulator

RNG = np.random.default_rng(5)
INPUT_ANGLES = ("x0", "-x1", "x2", "0.5*x0+1", "x1-x0+theta0", "theta1-x3", "x4+pi/2")
ANGLES = (*INPUT_ANGLES, "0.4", "pi", "-pi/2", "theta0", "2*theta1-pi/4")
GATES = (*FIXED_GATES, *(f"{name}({angle})" for name in ROTATION_GATES for angle in ANGLES))


def made(
    circuits: list[str] | Program,
    scale: list[float],
    feature: list[int] | None = None,
    theta: list[float] | None = None,
    function: str = "arctan",
    actions: int = 3,
    reuse: int = 1,
) -> Policy:
    """A policy of these circuits; missing parameters are random."""
    if isinstance(circuits, Program):
        program = circuits
    else:
        count = 2 if theta is None else len(theta)
        program = Program.of(map(Circuit.parse, circuits), len(scale), count)
    feature = [*range(len(scale))] if feature is None else feature
    if theta is None:
        theta = RNG.normal(size=len(program.parameters)).tolist()
    return Policy(
        "made",
        "CartPole-v1",
        Encoder(function, np.array(feature), np.array(scale, dtype=float)),
        program,
        np.array(theta, dtype=float),
        RNG.normal(size=(actions, reuse * len(program))),
        RNG.normal(size=actions),
        reuse,
    )


def seen(features: int, size: int = 200) -> np.ndarray:
    """Observations with rows of zeros and of large numbers among them."""
    observations = RNG.normal(size=(size, features))
    observations[0], observations[1] = 0.0, 50.0
    return observations


def simulated(policy: Policy, observations: np.ndarray) -> np.ndarray:
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    return policy.probabilities(z)


def assert_equal_policies(policy: Policy) -> Surrogate:
    surrogate, observations = Surrogate.of(policy), seen(policy.encoder.features)
    found = surrogate.probabilities(observations)
    assert found.shape == (len(observations), policy.actions)
    np.testing.assert_allclose(found, simulated(policy, observations), rtol=0, atol=1e-12)
    return surrogate


def test_the_paper_s_circuit_is_two_functions_of_its_feature() -> None:
    """y = -sin(x) cos(theta) - cos(x)^2 sin(theta), x = arctan(u), by hand."""
    program, _ = parallel(2, 1)
    policy = made(program, [1.0, 2.5], theta=[0.3, -2.0])
    surrogate = Surrogate.of(policy)
    assert surrogate.terms == ("sin(x0)", "cos(x0)^2", "sin(x1)", "cos(x1)^2")
    by_hand = np.zeros((3, 4))
    for circuit, theta in enumerate((0.3, -2.0)):
        by_hand[:, 2 * circuit] = -policy.weights[:, circuit] * np.cos(theta)
        by_hand[:, 2 * circuit + 1] = -policy.weights[:, circuit] * np.sin(theta)
    np.testing.assert_allclose(surrogate.weights, by_hand, rtol=1e-14)
    np.testing.assert_array_equal(surrogate.bias, policy.bias)
    assert surrogate.parameter_count == 3 * 4 + 3

    observations = seen(2)
    u = observations * [1.0, 2.5]
    functions = np.stack([u / np.sqrt(1 + u**2), 1 / (1 + u**2)], axis=2).reshape(-1, 4)
    np.testing.assert_allclose(surrogate.features(observations), functions, rtol=0, atol=1e-15)
    expected = functions @ by_hand.T + policy.bias
    np.testing.assert_allclose(surrogate.logits(observations), expected, rtol=0, atol=1e-14)


def test_the_device_circuit_is_three_products() -> None:
    """h, rz(x0), ry(x1), rz(x2), rx(theta), turned by hand from the Bloch vector (1, 0, 0)."""
    program, feature = LAYOUTS["single"](4, 1)
    policy = made(program, [1.0, 3.0, 0.5], feature, [0.7])
    surrogate, observations = Surrogate.of(policy), seen(4)
    a, b, c = np.arctan(observations[:, 1:] * [1.0, 3.0, 0.5]).T
    y = np.sin(a) * np.cos(c) + np.cos(a) * np.cos(b) * np.sin(c)
    z = np.cos(0.7) * -np.cos(a) * np.sin(b) + np.sin(0.7) * y
    assert set(surrogate.terms) == {
        "sin(x0)*cos(x2)",
        "cos(x0)*sin(x1)",
        "cos(x0)*cos(x1)*sin(x2)",
    }
    expected = np.outer(z, policy.weights[:, 0]) + policy.bias
    np.testing.assert_allclose(surrogate.logits(observations), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", policy_names())
def test_shipped_policies_equal_their_surrogates(name: str) -> None:
    assert_equal_policies(load_policy(name))


@pytest.mark.parametrize("function", ENCODINGS)
@pytest.mark.parametrize("copies", [1, 3])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_equal_their_surrogates(layout: str, copies: int, function: str) -> None:
    program, feature = LAYOUTS[layout](4, copies)
    for scale in (RNG.uniform(0.3, 3, len(feature)), np.ones(len(feature))):
        assert_equal_policies(made(program, scale.tolist(), feature, function=function, reuse=4))


def reference(circuit: Circuit, values: dict[str, float]) -> float:
    """<Z> of a circuit from Qiskit's statevector."""
    built = QuantumCircuit(1)
    for gate in circuit.gates:
        if gate.angle is None:
            getattr(built, gate.name)(0)
        else:
            angle = gate.angle.constant + sum(c * values[s] for s, c in gate.angle.terms)
            getattr(built, gate.name)(angle, 0)
    p_zero, p_one = Statevector.from_int(0, 2).evolve(Operator(built)).probabilities()
    return float(p_zero - p_one)


def test_circuits_of_all_gates_equal_qiskit_s() -> None:
    """One action for each circuit, so that the logits are its <Z>."""
    texts = [" ".join(RNG.choice(GATES, RNG.integers(1, 10))) for _ in range(120)]
    texts += [f"sx {gate} h" for gate in GATES]
    assert set(GATES) <= {gate for text in texts for gate in text.split()}
    scale, feature = [1.0, 2.0, -1.0, 1.0, 0.0], [0, 1, 0, 0, 1]
    policy = made(texts, scale, feature, [0.6, -1.1], actions=len(texts))
    surrogate = Surrogate.of(
        Policy(
            *("made", "any", policy.encoder, policy.program, policy.theta),
            np.eye(len(texts)),
            np.zeros(len(texts)),
        )
    )
    observations = seen(2, 6)
    x = np.arctan(observations[:, feature] * scale)
    names = ("x0", "x1", "x2", "x3", "x4", "theta0", "theta1")
    expected = [
        [
            reference(circuit, dict(zip(names, (*row, 0.6, -1.1), strict=True)))
            for circuit in policy.program.circuits
        ]
        for row in x.tolist()
    ]
    np.testing.assert_allclose(surrogate.logits(observations), expected, rtol=0, atol=1e-12)
    assert {symbol for form in surrogate.forms for symbol in form.symbols} == {"x0", "x1"}


def test_terms_say_what_the_features_are() -> None:
    circuits = ["h ry(x0) rz(x1) ry(x0-0.5*x1) rz(2*x0) rx(1)", "ry(x0) rz(x2) rx(x0+x2)"]
    surrogate = Surrogate.of(made(circuits, [0.7, 1.3, 2.0]))
    observations = seen(3)
    names: dict[str, Any] = {"sin": np.sin, "cos": np.cos}
    names |= {f"x{i}": np.arctan(observations[:, i] * s) for i, s in enumerate((0.7, 1.3, 2.0))}
    columns = [eval(term.replace("^", "**"), names) for term in surrogate.terms]
    assert len(set(surrogate.terms)) == len(columns) > 5
    np.testing.assert_allclose(surrogate.features(observations), np.transpose(columns), atol=1e-13)


def test_no_sine_is_squared() -> None:
    program, feature = serial(1, 3)
    terms = Surrogate.of(made(program, [1.0] * 3, feature)).terms
    assert all(re.fullmatch(r"(cos\(x0\)(\^\d)?)?\*?(sin\(x0\))?", term) for term in terms)


def test_copies_with_one_scale_add_no_term() -> None:
    one, _ = parallel(4, 1)
    three, feature = parallel(4, 3)
    scale = [1.0, 2.0, 0.5, 1.0]
    alone = Surrogate.of(made(one, scale))
    assert assert_equal_policies(made(three, scale * 3, feature)).terms == alone.terms
    other = [*scale, *scale, 3.0, 2.0, 0.5, 1.0]
    added = assert_equal_policies(made(three, other, feature)).terms
    assert set(added) - set(alone.terms) == {"sin(x8)", "cos(x8)^2"}


@pytest.mark.parametrize(
    ("circuits", "scale", "terms"),
    [
        (["ry(x0)", "ry(-x0)", "ry(x0+pi/2)", "ry(1-x0)"], [1.0], ("cos(x0)", "sin(x0)")),
        (["ry(x0)", "ry(x1+1)"], [1.5, -1.5], ("cos(x0)", "sin(x0)")),
        (["ry(x1)", "ry(x0+1)"], [-1.5, 1.5], ("cos(x0)", "sin(x0)")),
        (["h ry(x0)", "ry(x1)"], [0.0, 1.0], ("cos(x1)",)),
        (["h ry(x0+x1)"], [1.0, -1.0], ()),
        (["ry(x1-x0+x2)"], [1.0, 1.0, 1.0], ("cos(x0)",)),
        (["ry(x0-x1)", "h ry(x1-x0)"], [1.0, 2.0], ("cos(x0-x1)", "sin(x0-x1)")),
        (["ry(0.25*x0)"], [1.0], ("cos(0.25*x0)",)),
    ],
)
def test_angles_that_are_equal_share_their_functions(
    circuits: list[str], scale: list[float], terms: tuple[str, ...]
) -> None:
    """All inputs read the one feature there is."""
    surrogate = assert_equal_policies(made(circuits, scale, [0] * len(scale)))
    assert surrogate.terms == terms


@pytest.mark.parametrize("function", ENCODINGS)
def test_encoders_are_odd(function: str) -> None:
    """Inputs of opposite scales share their functions because of this."""
    x = np.linspace(0, 5, 11)
    np.testing.assert_array_equal(ENCODINGS[function](-x), -ENCODINGS[function](x))


@pytest.mark.parametrize(
    ("theta", "terms"),
    [
        (0.0, ("sin(x0)",)),
        (np.pi, ("sin(x0)",)),
        (-np.pi / 2, ("cos(x0)^2",)),
        (2 * np.pi + 1e-9, ("sin(x0)", "cos(x0)^2")),
    ],
)
def test_what_cancels_leaves_no_term(theta: float, terms: tuple[str, ...]) -> None:
    policy = made(["z h s ry(0) sdg sx sxdg ry(x0) rz(x0) ry(theta0) t"], [1.0], theta=[theta])
    assert assert_equal_policies(policy).terms == terms


def test_circuits_without_inputs_are_a_bias() -> None:
    """ry(theta) from |0> has <Z> = cos(theta)."""
    policy = made(["ry(theta0) rz(x0)", "rz(x0)", ""], [1.0], theta=[0.8])
    surrogate = assert_equal_policies(policy)
    assert (surrogate.terms, surrogate.weights.shape) == ((), (3, 0))
    by_hand = policy.bias + policy.weights @ [np.cos(0.8), 1.0, 1.0]
    np.testing.assert_allclose(surrogate.bias, by_hand, rtol=1e-14)
    assert surrogate.features(np.zeros((5, 1))).shape == (5, 0)


def test_observations_with_too_few_features_are_refused() -> None:
    surrogate = Surrogate.of(made(["ry(x1)"], [1.0, 1.0]))
    with pytest.raises(PolicyError, match=r"needs \(B, 2\) or wider"):
        surrogate.probabilities(np.zeros((3, 1)))


def test_too_many_angles_on_one_qubit_are_refused() -> None:
    text = "h " + " ".join(f"ry(x{i}) rz(x{i})" for i in range(12))
    with pytest.raises(PolicyError) as caught:
        Surrogate.of(made(["h", text], [1.0] * 12))
    assert re.fullmatch(
        r"Circuit 1 has too many terms for a surrogate\.\n"
        r"  It has [\d,]+; the limit is 10,000\.\n"
        r"  Each different angle in a circuit multiplies them: put fewer inputs on a qubit, "
        r"or give the copies of an input the same scale\.",
        str(caught.value),
    )


def test_too_many_terms_of_all_circuits_are_refused() -> None:
    program, feature = serial(8, 6)
    policy = made(program, RNG.uniform(1, 2, len(feature)).tolist(), feature)
    with pytest.raises(PolicyError, match="The policy has too many terms"):
        Surrogate.of(policy)


def test_terms_that_nearly_cancel_are_refused() -> None:
    """cos(n x) in powers of cos(x) has coefficients that grow as 2^n."""
    text = " ".join(["ry(x0) rz(0.01)"] * 40)
    with pytest.raises(PolicyError, match=r"circuit 0 would not be exact.*\n.*10,000.*\n.*fewer"):
        Surrogate.of(made([text], [1.0]))
