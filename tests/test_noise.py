"""Noise against Aer's density matrix, Qiskit's channels, and hand calculations."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import pytest
from noisy import noisy_circuits
from qiskit import QuantumCircuit
from qiskit.quantum_info import PTM, average_gate_fidelity
from qiskit_aer import AerSimulator
from qiskit_aer.noise import NoiseModel, depolarizing_error, thermal_relaxation_error
from qiskit_aer.noise.noiseerror import NoiseError

from qcompile.device import IDEAL, Device, GateCalibration, Qubit, load_device
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.noise import channel_after, noise_after, readout_row
from qcompile.noise.channels import depolarising, relaxation, relaxation_error
from qcompile.passes import Executable, compile
from qcompile.snapshot import find_backend

CIRCUITS = (
    "h ry(x0) rz(x0) ry(theta0)",
    "h ry(x0) rz(x0) ry(theta0) h ry(x1) rz(x1) ry(theta1)",
    "ry(x0) rz(0.3*x1+theta0) rx(theta1-1) sxdg p(x0+x1) h tdg ry(2*x0)",
    "rx(0.7) t ry(-2.1) s sx rz(0.4) h",
    "y rx(x0) z sdg ry(theta1)",
    "ry(pi/2) rz(x1) ry(pi/2)",
    "x",
    "h",
    "id",
    "y",
    "sx sx",
    "",
)


def random_circuits(count: int, seed: int) -> list[str]:
    """Texts of one to ten gates of the whole gate table."""
    rng = np.random.default_rng(seed)
    angles = ("0.4", "x0", "x1-theta0", "0.5*x0+2*theta1-pi/2", "pi", "-pi/2", "theta1+1")
    gates = [*FIXED_GATES, *(f"{name}({angle})" for name in ROTATION_GATES for angle in angles)]
    return [" ".join(rng.choice(gates, rng.integers(1, 11))) for _ in range(count)]


PROGRAM = Program.of(
    map(Circuit.parse, [*CIRCUITS, *random_circuits(20, seed=5)]), inputs=2, parameters=2
)
X = np.random.default_rng(7).normal(size=(3, 2))
THETA = np.array([0.6, -2.2])


def on_qubit(executable: Executable, qubit: int) -> Executable:
    """The executable with every circuit on one physical qubit, one a round."""
    count = len(executable.native)
    return dataclasses.replace(executable, qubits=np.full(count, qubit), rounds=np.arange(count))


def bound(executable: Executable, qubit: int) -> list[QuantumCircuit]:
    """The native circuits on `qubit` with bound angles, gate by gate, for every observation."""
    made = []
    for angles in executable.bind(X, THETA):
        for index, circuit in enumerate(executable.native.circuits):
            values = iter(angles[executable.slot_circuits == index])
            built = QuantumCircuit(qubit + 1)
            for gate in circuit.gates:
                if gate.angle is None:
                    getattr(built, gate.name)(qubit)
                else:
                    getattr(built, gate.name)(float(next(values)), qubit)
            built.save_density_matrix([qubit])
            made.append(built)
    return made


def probabilities(circuits: list[QuantumCircuit], noise: NoiseModel) -> np.ndarray:
    """P(0), P(1) before readout, (circuits, 2), from one run of Aer without transpiling."""
    simulator = AerSimulator(
        method="density_matrix", noise_model=noise, fusion_enable=False, max_parallel_threads=1
    )
    result = simulator.run(circuits, shots=1).result()
    matrices = [np.asarray(result.data(i)["density_matrix"]) for i in range(len(circuits))]
    return np.real(np.diagonal(matrices, axis1=1, axis2=2))


def _alone(properties, qubits: Sequence[int]) -> None:
    """Keep these `qubits` and their one-qubit gates alone, numbered from 0.

    Aer asks for a frequency, which IBM no longer publishes; at temperature 0 it matters to nothing.
    """
    gates = [g for g in properties.gates if len(g.qubits) == 1 and g.qubits[0] in qubits]
    for gate in gates:
        gate.qubits = [qubits.index(gate.qubits[0])]
    properties.gates = [g for g in gates if g.gate in ("id", "rz", "sx", "x")]
    properties.qubits = [properties.qubits[q] for q in qubits]
    properties._qubits = {
        i: {"frequency": (5e9, None)} | properties._qubits[q] for i, q in enumerate(qubits)
    }
    properties._gates = {
        name: {(qubits.index(q[0]),): of[q] for q in of if q[0] in qubits}
        for name, of in properties._gates.items()
        if name in ("id", "rz", "sx", "x")
    }


@pytest.mark.parametrize(
    ("name", "qubits"),
    [("fake_lima", range(5)), ("fake_jakarta", range(7)), ("fake_fez", (0, 113, 155)),
     ("fake_kingston", (1, 112, 155))],
)  # fmt: skip
def test_noisy_expectations_equal_aer_s_density_matrix(name: str, qubits: Sequence[int]) -> None:
    properties = find_backend(name).properties()
    _alone(properties, qubits)
    device = load_device(name)
    device = device.model_copy(
        update={"qubits": tuple(device.qubits[q] for q in qubits), "left_out": ()}
    )
    ours, circuits, assignment = [], [], []
    for level in (0, 1, 2):
        executable = compile(PROGRAM, device, level)
        for qubit in range(len(qubits)):
            placed = on_qubit(executable, qubit)
            ours.append(noisy_circuits(placed).expectation(placed.bind(X, THETA)).ravel())
            circuits += bound(placed, qubit)
            values = properties.qubit_property(qubit)
            p10, p01 = values["prob_meas1_prep0"][0], values["prob_meas0_prep1"][0]
            matrix = np.array([[1 - p10, p01], [p10, 1 - p01]])
            assignment += [matrix] * ours[-1].size
    true = probabilities(circuits, NoiseModel.from_backend_properties(properties))
    measured = np.einsum("cij,cj->ci", assignment, true)
    theirs = measured[:, 0] - measured[:, 1]
    np.testing.assert_allclose(np.concatenate(ours), theirs, rtol=0, atol=1e-9)
    # The noise is there to be seen: the true <Z> is far from the measured one.
    assert np.abs(theirs - (true[:, 0] - true[:, 1])).max() > 1e-2


RX_QUBITS = (
    Qubit(t1_us=80, t2_us=60, p10=0.01, p01=0.04, readout_ns=None,
          gates={"rx": GateCalibration(error=2e-3, length_ns=60)}),
    # T2 above 2 T1, and an rz that is not free.
    Qubit(t1_us=20, t2_us=90, p10=0.2, p01=0.0,
          gates={"rx": GateCalibration(error=0.1, length_ns=500),
                 "rz": GateCalibration(error=5e-3, length_ns=10)}),
)  # fmt: skip


@pytest.mark.parametrize("qubit", [0, 1])
def test_native_rx_equals_aer_with_its_own_noise(qubit: int) -> None:
    device = Device(name="fractional", source="by hand", basis_gates=("rz", "rx"), qubits=RX_QUBITS)
    physical = device.qubits[qubit]
    noise = NoiseModel(basis_gates=["rz", "rx"])
    for name, gate in physical.gates.items():
        relaxation = thermal_relaxation_error(
            1e3 * physical.t1_us, 1e3 * min(physical.t2_us, 2 * physical.t1_us), gate.length_ns
        )
        kept = average_gate_fidelity(relaxation)
        share = 2 * (kept - (1 - gate.error)) / (2 * kept - 1)
        error = depolarizing_error(share, 1).compose(relaxation)
        assert average_gate_fidelity(error) == pytest.approx(1 - gate.error, abs=1e-12)
        noise.add_all_qubit_quantum_error(error, [name])
    for level in (0, 1, 2):
        placed = on_qubit(compile(PROGRAM, device, level), qubit)
        names = {g.name for c in placed.native.circuits for g in c.gates}
        assert names <= ({"rz", "rx"} if level else {"rz", "rx", "id"})
        true = probabilities(bound(placed, qubit), noise)
        theirs = true @ [1 - 2 * physical.p10, 2 * physical.p01 - 1]
        ours = noisy_circuits(placed).expectation(placed.bind(X, THETA))
        np.testing.assert_allclose(ours.ravel(), theirs, rtol=0, atol=1e-9)


def a_qubit(error: float, length_ns: float, t1_us: float = 100.0, t2_us: float = 100.0) -> Qubit:
    gate = GateCalibration(error=error, length_ns=length_ns)
    return Qubit(t1_us=t1_us, t2_us=t2_us, p10=0.01, p01=0.03, gates={"sx": gate})


def test_the_depolarising_probability_by_hand() -> None:
    # Without time there is no relaxation: 1 - F = p / 2.
    instant = a_qubit(1e-3, 0.0)
    assert depolarising(instant.gates["sx"], instant) == pytest.approx(2e-3, rel=1e-12)
    # T1 = T2 = 100 us and 100 ns: e = exp(-0.001), relaxation alone has 1 - F = (1 - e) / 2, so
    # p = 2 (0.001 - (1 - e) / 2) / e = (0.002 - 1 + e) / e with e = 0.99900049983337...
    slow = a_qubit(1e-3, 100.0)
    assert relaxation_error(slow, 100.0) == pytest.approx(4.9975008331e-4, rel=1e-9)
    assert depolarising(slow.gates["sx"], slow) == pytest.approx(1.0015008336e-3, rel=1e-8)


@pytest.mark.parametrize(
    ("error", "length_ns", "t1_us", "t2_us"),
    [(1e-3, 35.0, 80, 60), (0.05, 100.0, 50, 100), (0.3, 500.0, 30, 90), (0.02, 0.0, 10, 10)],
)
def test_the_noise_has_the_fidelity_of_the_calibration(error, length_ns, t1_us, t2_us) -> None:
    noise = noise_after("sx", a_qubit(error, length_ns, t1_us, t2_us))
    assert average_gate_fidelity(PTM(noise)) == pytest.approx(1 - error, abs=1e-12)
    assert PTM(noise).is_cptp()


def test_an_error_below_relaxation_is_pure_relaxation() -> None:
    qubit = a_qubit(1e-6, 200.0, t1_us=50, t2_us=40)
    assert depolarising(qubit.gates["sx"], qubit) == 0.0
    reference = PTM(thermal_relaxation_error(50e3, 40e3, 200.0)).data
    np.testing.assert_allclose(noise_after("sx", qubit), reference, atol=1e-14)


@pytest.mark.parametrize("error", [0.0, 0.4, 0.6, 1.0])
def test_the_extremes_stay_physical(error: float) -> None:
    for length_ns in (0.0, 1e5, 1e12):
        noise = noise_after("sx", a_qubit(error, length_ns))
        assert PTM(noise).is_cptp(atol=1e-9)
    # After a very long time only |0> is left, whatever the stated error.
    np.testing.assert_allclose(noise[1:], [[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0]], atol=1e-15)


def test_a_gate_without_calibration_is_free_of_noise() -> None:
    np.testing.assert_array_equal(noise_after("rz", a_qubit(0.1, 10.0)), np.eye(4))
    np.testing.assert_array_equal(noise_after("sx", None), np.eye(4))


def test_the_fields_of_a_channel() -> None:
    """T1 = 100 us, T2 = 50 us, 10 us: exp(-0.2) across, exp(-0.1) along, the rest to |0>."""
    qubit = a_qubit(0.0, 10_000.0, t1_us=100, t2_us=50)
    for channel in (relaxation(qubit, 10_000.0), channel_after("sx", qubit)):
        assert channel.across == pytest.approx(0.8187307530779818, rel=1e-12)
        assert channel.along == pytest.approx(0.9048374180359595, rel=1e-12)
        assert channel.added == pytest.approx(0.0951625819640405, rel=1e-12)


def test_the_readout_row_by_hand() -> None:
    # |0> gives 1 with probability 0.01, |1> gives 0 with 0.03.
    row = readout_row(a_qubit(0.0, 0.0))
    assert row @ [1, 0, 0, 1] == pytest.approx(1 - 2 * 0.01)
    assert row @ [1, 0, 0, -1] == pytest.approx(-(1 - 2 * 0.03))
    np.testing.assert_array_equal(readout_row(None), [0, 0, 0, 1])


@pytest.mark.parametrize("name", ["fake_lagos", "fake_toronto", "ibm_lima"])
def test_one_slot_answers_with_a_response_curve(name: str) -> None:
    device = load_device(name)
    executable = compile(Program.of([Circuit.parse("ry(x0)")], inputs=1), device)
    angle = np.random.default_rng(3).uniform(-7, 7, 200)
    for qubit in range(len(device.qubits)):
        noisy = noisy_circuits(on_qubit(executable, qubit))
        at = noisy.expectation(np.array([0.0, np.pi / 2, np.pi]).reshape(3, 1))[:, 0]
        b, c = (at[0] + at[2]) / 2, (at[0] - at[2]) / 2
        s = at[1] - b
        curve = b + c * np.cos(angle) + s * np.sin(angle)
        np.testing.assert_allclose(noisy.expectation(angle[:, None])[:, 0], curve, atol=1e-14)
        assert math.hypot(c, s) + abs(b) <= 1 + 1e-12


def test_the_ideal_device_has_no_noise() -> None:
    for level in (0, 1, 2):
        executable = compile(PROGRAM, IDEAL, level)
        ours = noisy_circuits(executable).expectation(executable.bind(X, THETA))
        true = probabilities(bound(executable, 0), NoiseModel())
        np.testing.assert_allclose(ours.ravel(), true[:, 0] - true[:, 1], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "gates", "sign"),
    [("h rz(x0) sx", ("rz", "sx", "x"), 1), ("rx(pi/2) rx(x0)", ("rz", "rx"), -1)],
)
def test_the_last_slot_acts_on_a_vector_that_lies_across(
    text: str, gates: tuple[str, ...], sign: int
) -> None:
    """(cos a, sin a, 0), whose y sx turns to z; and Rx(a + pi/2), whose <Z> is -sin(a)."""
    perfect = Qubit(t1_us=1, t2_us=1, p10=0, p01=0)
    device = Device(name="perfect", source="by hand", basis_gates=gates, qubits=(perfect,))
    executable = compile(Program.of([Circuit.parse(text)], inputs=1), device, 0)
    angle = np.linspace(-3, 3, 7)[:, None]
    slots = executable.bind(angle, np.zeros(0))
    ours = noisy_circuits(executable).expectation(slots)
    np.testing.assert_allclose(ours, sign * np.sin(angle), atol=1e-14)


def test_a_batch_is_its_rows() -> None:
    executable = compile(PROGRAM, load_device("fake_lima"), 1)
    noisy, angles = noisy_circuits(executable), executable.bind(X, THETA)
    rows = [noisy.expectation(angles[i : i + 1]) for i in range(len(X))]
    np.testing.assert_array_equal(noisy.expectation(angles), np.concatenate(rows))
    assert noisy.expectation(angles[:0]).shape == (0, len(PROGRAM))


def test_an_error_beyond_all_channels_is_the_strongest_depolarising_one() -> None:
    """Qiskit takes a probability of 4/3 for one qubit and not the next number above it."""
    qubit = Qubit(t1_us=1, t2_us=1, p10=0, p01=0)
    calibration = GateCalibration(error=0.99, length_ns=200)
    assert 0.05 < relaxation_error(qubit, 200) < 0.2
    found = depolarising(calibration, qubit)
    transfer = PTM(depolarizing_error(found, 1)).data
    np.testing.assert_allclose(np.diag(transfer), [1, -1 / 3, -1 / 3, -1 / 3], atol=1e-12)
    with pytest.raises(NoiseError):
        depolarizing_error(found * (1 + 1e-9), 1)
