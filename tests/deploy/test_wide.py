"""Policies of circuits of several qubits, played on noise models."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wide_policies import OBSERVATIONS, ideal, policy

import qcompile
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.deploy.settings import RunSettings
from qcompile.errors import CircuitError, DeviceError
from qcompile.execution import Executor, Prepared
from qcompile.ir import Circuit, Program
from qcompile.noise import usable
from qcompile.passes import Executable
from qcompile.report.summary import run_facts
from qcompile.streams import Stream


def test_without_noise_it_decides_by_the_statevector() -> None:
    deployment = Deployment(policy(), "ideal", shots=None, seed=1)
    found = deployment.expectation(OBSERVATIONS)
    np.testing.assert_allclose(found, ideal(), atol=1e-12)
    u = Stream(1, "actions").uniforms(np.arange(4), np.zeros(4, int))
    np.testing.assert_array_equal(deployment.act(OBSERVATIONS), policy().decide(ideal(), u))


def test_mitigation_undoes_the_readout_of_products() -> None:
    """What is left are the errors of gates: a fraction of what the readout takes."""
    plain, mitigated = (
        np.abs(
            Deployment(policy(), "fake_lima", shots=None, mitigation=m).expectation(OBSERVATIONS)
            - ideal()
        ).max(axis=0)
        for m in ("none", "readout")
    )
    assert (mitigated < plain).all()
    assert mitigated[3] < 0.6 * plain[3]  # <ZZZ> loses most


def test_counts_are_those_of_the_stated_shots() -> None:
    settings = RunSettings.of(None, shots=64, mitigation="none", seed=2)
    deployment = Deployment(policy(), "fake_lima", settings)
    exact = Deployment(policy(), "fake_lima", RunSettings.of(settings, shots=None))
    rows = np.repeat(OBSERVATIONS[:1], 3000, axis=0)
    z = deployment.expectation(rows)
    wanted = exact.expectation(OBSERVATIONS[:1])[0]
    sigma = np.sqrt((1 - wanted**2) / (64 * 3000))
    assert (np.abs(z.mean(axis=0) - wanted) < 4.5 * sigma).all()


@pytest.mark.parametrize("backend", ["ideal", "fake_lima"])
def test_measuring_ahead_changes_nothing(backend: str) -> None:
    runs = [
        play(
            Deployment(policy(), backend, shots=32, seed=5, max_steps=30, speculate=depth),
            4,
        )
        for depth in (1, 8, "auto")
    ]
    assert len({str(run.episodes) for run in runs}) == 1


def test_a_run_counts_the_couplings() -> None:
    result = qcompile.run(policy(), "fake_lima", episodes=2, shots=32, max_steps=5, progress=False)
    values = result.to_dict()
    native = qcompile.compile(policy().trained_program, qcompile.load_device("fake_lima")).native
    count = sum(gate.is_coupling for gate in native.circuits[0].gates)
    assert count > 0
    assert values["gates_per_circuit"]["cx"] == values["couplings_per_circuit"] == count
    assert (values["circuits_per_step"], values["observables_per_step"]) == (2, 5)
    assert "5 observables, 1 round" in dict(run_facts(values))["each step"]


def test_products_of_circuits_of_one_qubit_are_reported_too() -> None:
    """Observables in another order, without any coupling, and on a device that has none."""
    program = replace(Program.of([Circuit.parse("ry(x0)"), Circuit.parse("ry(x1)")], 4, 2))
    swapped = replace(program, observables=((1,), (0,)))
    other = replace(policy(), program=swapped, weights=np.eye(2))
    plain = replace(other, program=program, weights=np.eye(2)[:, ::-1])
    found, expected = (Deployment(p, "ibm_lima", shots=None) for p in (other, plain))
    np.testing.assert_allclose(
        found.expectation(OBSERVATIONS), expected.expectation(OBSERVATIONS)[:, ::-1], atol=1e-9
    )
    result = qcompile.run(other, "ibm_lima", episodes=2, shots=32, max_steps=5, progress=False)
    result.report("narrow.html")
    assert "observables: &lt;Z1&gt;, &lt;Z0&gt;" in Path("narrow.html").read_text()


def test_fewer_bits_than_there_are_may_be_measured() -> None:
    """The circuit of the observable that matters most is on the best qubit."""
    program = replace(Program.of([Circuit.parse("ry(x0)")] * 3, 1), observables=((2,), (0,)))
    device = qcompile.load_device("fake_lima")
    placed = qcompile.compile(program, device, importance=np.array([1.0, 5.0]))
    assert placed.qubits.tolist() == [usable(device)[rank] for rank in (0, 2, 1)]


def test_fewer_observables_than_circuits() -> None:
    """The one circuit that is observed gets the best qubit."""
    circuits = [Circuit.parse("ry(x0)"), Circuit.parse("ry(x1)"), Circuit.parse("ry(x2)")]
    program = replace(Program.of(circuits, 4, 2), observables=((2,),))
    one = replace(policy(), program=program, weights=np.array([[2.0], [-1.0]]))
    deployment = Deployment(one, "ibm_lima", shots=None, mitigation="none")
    assert deployment.expectation(OBSERVATIONS).shape == (4, 1)
    assert deployment.executable.qubits[2] == usable(deployment.device)[0]


@pytest.fixture(autouse=True)
def _folder(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(str(tmp_path))


def test_what_cannot_be_measured_is_refused() -> None:
    for settings in ({"mitigation": "response"}, {"predistort": True}):
        executor = Unused("fake_lima")
        with pytest.raises(CircuitError, match=r"needs circuits of one qubit.*\n.*mitigation re"):
            Deployment(policy(), executor, **settings)
    with pytest.raises(CircuitError, match="A twin needs circuits of one qubit"):
        Deployment(policy(), qcompile.calibrate("fake_lima", seed=0, progress=False))
    with pytest.raises(DeviceError, match="ibm_lima has no couplings"):
        Deployment(policy(), "ibm_lima")


class Unused(Executor):
    """An executor on which nothing may run: it would be paid for."""

    kind = "hardware"

    def __init__(self, name: str):
        self.device = qcompile.load_device(name)

    def prepare(self, executable: Executable) -> Prepared:
        raise AssertionError("something was measured")
