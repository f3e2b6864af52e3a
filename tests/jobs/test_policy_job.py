"""Jobs: the contents of job.json, and programs that Qiskit reads back as the policy's circuits."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm2, qasm3
from qiskit.quantum_info import Pauli, Statevector

from qcompile.device import load_device
from qcompile.errors import CircuitError, OutputError, PolicyError
from qcompile.ir import Circuit, Program
from qcompile.jobs.policy_job import export_job, read_observations
from qcompile.passes import compile
from qcompile.policy import Encoder, Policy, load_policy
from qcompile.qasm import read
from qcompile.simulate import Simulator

RNG = np.random.default_rng(0)
OBSERVATIONS = np.vstack([RNG.normal(size=(3, 3)), np.zeros(3), [0.0, 0.3, 1e9]])
"""Some rows at random, some at angles of 0 and pi/2, where fewer gates do."""
TEXTS = [
    "h ry(x0) rz(x0) ry(theta0)",
    "h ry(x1) rz(x1) ry(theta1)",
    "h rz(x0) ry(0.5*x1+theta1-1.57) rz(x2) rx(theta0)",
    "x",
    "ry(theta0) sx ry(1.2)",
    "h ry(-x2+1.2) rz(2*x2) ry(theta1) rz(x0) ry(x0)",
    "h",
]
"""Seven circuits, two rounds on five qubits; some are fixed, some share inputs."""


def make() -> Policy:
    program = Program.of(map(Circuit.parse, TEXTS), 3, 2)
    encoder = Encoder("arctan", np.array([2, 0, 1]), np.array([1.0, 2.0, 0.5]))
    return Policy(
        "seven", "any", encoder, program, np.array([0.7, -2.1]), np.ones((2, 7)), np.zeros(2)
    )


def expected_z() -> np.ndarray[Any, Any]:
    """<Z> of every circuit for every observation, by Qiskit from the texts above."""
    observed = OBSERVATIONS
    inputs = np.arctan(np.stack([observed[:, 2], 2 * observed[:, 0], observed[:, 1] / 2], axis=1))
    z = np.empty((len(inputs), len(TEXTS)))
    for row, (x0, x1, x2) in enumerate(inputs):
        names = {"x0": x0, "x1": x1, "x2": x2, "theta0": 0.7, "theta1": -2.1}
        for column, text in enumerate(TEXTS):
            circuit = QuantumCircuit(1)
            for gate in text.split():
                name, _, angle = gate.rstrip(")").partition("(")
                angles = [eval(angle, {}, names)] if angle else []
                getattr(circuit, name)(*angles, 0)
            z[row, column] = Statevector(circuit).expectation_value(Pauli("Z")).real
    return z


def measured_z(circuit: QuantumCircuit) -> list[float]:
    """<Z> of the qubit that each bit of register c reads, bit by bit."""
    qubit_of = {}
    for instruction in circuit.data:
        if instruction.operation.name == "measure":
            bit = circuit.find_bit(instruction.clbits[0]).registers[0]
            assert bit[0].name == "c"
            qubit_of[bit[1]] = circuit.find_bit(instruction.qubits[0]).index
    assert sorted(qubit_of) == list(range(len(qubit_of)))
    state = Statevector(circuit.remove_final_measurements(inplace=False))
    return [
        state.expectation_value(Pauli("Z"), [qubit_of[bit]]).real for bit in range(len(qubit_of))
    ]


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("backend", ["ideal", "ibm_lima"])
def test_a_parametric_job_is_the_policy(tmp_path: Path, backend: str, level: int) -> None:
    """Inputs take encoded features at level 0 and bound slots, in order, above it."""
    policy, device = make(), load_device(backend)
    job = export_job(policy, device, tmp_path / "job", level=level, shots=1024)
    assert job == json.loads((tmp_path / "job" / "job.json").read_text())
    assert set(job) == {"format", "backend", "level", "shots", "programs"}
    assert job["format"] == "qcompile-job-1"
    assert (job["backend"], job["level"], job["shots"]) == (backend, level, 1024)
    assert len(job["programs"]) == (1 if backend == "ideal" else 2)
    files = sorted(["job.json", *(p["file"] for p in job["programs"])])
    assert files == sorted(path.name for path in (tmp_path / "job").iterdir())

    x = policy.encode(OBSERVATIONS)
    executable = compile(policy.program, device, level)
    slots = executable.bind(x, policy.theta)
    columns = zip(executable.slot_circuits, executable.slot_positions, strict=True)
    column_of = {place: column for column, place in enumerate(columns)}
    found = np.full((len(OBSERVATIONS), len(TEXTS)), np.nan)
    for program in job["programs"]:
        assert set(program) == {"file", "circuits", "qubits", "inputs", "observation"}
        assert program["observation"] is None
        text = (tmp_path / "job" / program["file"]).read_text()
        declared = [line[16:-1] for line in text.splitlines() if line.startswith("input")]
        assert program["inputs"] == declared
        circuit = qasm3.loads(text)
        assert {p.name for p in circuit.parameters} == set(declared)
        for row in range(len(x)):
            if level == 0:
                named = {name: x[row, int(name[1:])] for name in program["inputs"]}
            else:
                places = [name[1:].split("_") for name in program["inputs"]]
                at = [(int(circuit_index), int(slot)) for circuit_index, slot in places]
                assert at == sorted(at)
                named = {
                    name: slots[row, column_of[place]]
                    for name, place in zip(program["inputs"], at, strict=True)
                }
            bound = circuit.assign_parameters(named)
            found[row, program["circuits"]] = measured_z(bound)
    np.testing.assert_allclose(found, expected_z(), atol=1e-9)


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("backend", ["ideal", "ibm_lima"])
@pytest.mark.parametrize("format", ["qasm3", "qasm2"])
def test_a_bound_job_is_the_policy(tmp_path: Path, backend: str, level: int, format: Any) -> None:
    policy, device = make(), load_device(backend)
    folder = tmp_path / "job"
    job = export_job(policy, device, folder, level=level, format=format, observations=OBSERVATIONS)
    found = np.full((len(OBSERVATIONS), len(TEXTS)), np.nan)
    for program in job["programs"]:
        assert program["inputs"] == []
        text = (folder / program["file"]).read_text()
        circuit = qasm3.loads(text) if format == "qasm3" else qasm2.loads(text)
        assert np.isnan(found[program["observation"], program["circuits"]]).all()
        found[program["observation"], program["circuits"]] = measured_z(circuit)
    np.testing.assert_allclose(found, expected_z(), atol=1e-9)
    assert job["shots"] == 8192


def test_rounds_name_the_qubits_of_the_device(tmp_path: Path) -> None:
    """Seven circuits on five equal qubits: two rounds on the first three, one on the next."""
    job = export_job(make(), load_device("ibm_lima"), tmp_path / "job")
    assert [p["circuits"] for p in job["programs"]] == [[0, 2, 4, 6], [1, 3, 5]]
    for program in job["programs"]:
        text = (tmp_path / "job" / program["file"]).read_text()
        assert len(set(program["qubits"])) == len(program["qubits"])
        assert "qubit[" not in text
        for bit, qubit in enumerate(program["qubits"]):
            assert f"c[{bit}] = measure ${qubit};" in text


def test_the_best_readout_comes_first(tmp_path: Path) -> None:
    device = load_device("fake_lima")
    errors = [qubit.p01 + qubit.p10 for qubit in device.qubits]
    job = export_job(make(), device, tmp_path / "job")
    used = job["programs"][0]["qubits"]
    assert [errors[q] for q in used] == sorted(errors)[: len(used)]


def test_openqasm_2_needs_observations(tmp_path: Path) -> None:
    with pytest.raises(CircuitError, match="Give --observations FILE"):
        export_job(make(), load_device("ideal"), tmp_path / "job", format="qasm2")
    assert not list(tmp_path.iterdir())


def test_a_folder_in_use_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("keep")
    for folder in (tmp_path, tmp_path / "mine"):
        with pytest.raises(OutputError, match="already exists"):
            export_job(make(), load_device("ideal"), folder)
    with pytest.raises(OutputError, match=r"Cannot (write|make)"):
        export_job(make(), load_device("ideal"), tmp_path / "mine" / "job")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert (tmp_path / "mine").read_text() == "keep"


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    (tmp_path / "a" / "job").mkdir(parents=True)
    export_job(make(), load_device("ideal"), tmp_path / "a" / "job")
    assert (tmp_path / "a" / "job" / "job.json").is_file()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["job"]


@pytest.mark.parametrize("fault", ["disk full", "wrong observation"])
def test_a_failed_job_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    observations = OBSERVATIONS.copy()
    if fault == "disk full":

        def full(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "replace", full)
    else:
        observations[2, 1] = np.nan
    with pytest.raises(OutputError if fault == "disk full" else PolicyError):
        export_job(make(), load_device("ideal"), tmp_path / "job", observations=observations)
    assert not list(tmp_path.iterdir())


def test_observations_are_read_from_each_format(tmp_path: Path) -> None:
    rows = np.array([[1.0, -2.5, 1e-7], [0.1, 3.0, 4.0]])
    np.save(tmp_path / "o.npy", rows.astype(np.float32).astype(float))
    (tmp_path / "o.json").write_text(json.dumps(rows.tolist()))
    (tmp_path / "o.csv").write_text("1.0,-2.5,1e-7\n# a remark\n0.1,3,4\n")
    (tmp_path / "one.json").write_text("[1, -2.5, 1e-7]")
    (tmp_path / "one.csv").write_text("1,-2.5,1e-7")
    for name in ("o.json", "o.csv"):
        np.testing.assert_array_equal(read_observations(tmp_path / name, make()), rows)
    npy = read_observations(tmp_path / "o.npy", make())
    np.testing.assert_array_equal(npy, rows.astype(np.float32))
    for name in ("one.json", "one.csv"):
        np.testing.assert_array_equal(read_observations(tmp_path / name, make()), rows[:1])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("o.json", ""),
        ("o.json", "[]"),
        ("o.json", '{"a": 1}'),
        ("o.json", "[[1, 2, 3], [4, 5]]"),
        ("o.json", '[["a", 2, 3]]'),
        ("o.json", "[[1, 2, NaN]]"),
        ("o.json", "[[1, 2, null]]"),
        ("o.json", "[" * 100_000),
        ("o.csv", ""),
        ("o.csv", "# nothing\n"),
        ("o.csv", "cart,pole,speed\n1,2,3\n"),
        ("o.csv", "1,2,3\n4,5\n"),
        ("o.csv", "1,2,inf\n"),
        ("o.npy", ""),
        ("o.npy", "no array"),
        ("o.npy", "PK\x03\x04 no archive"),
    ],
)
def test_wrong_observations_are_refused(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(PolicyError, match="holds no observation"):
        read_observations(path, make())


def test_observations_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "o.npy"
    for array in (np.array([object()]), np.ones((2, 3)) * 1j, np.array([["a", "b", "c"]])):
        np.save(path, array, allow_pickle=True)
        with pytest.raises(PolicyError, match="holds no observation"):
            read_observations(path, make())
    np.savez(tmp_path / "o.npz", a=np.ones((2, 3)))
    (tmp_path / "o.npz").rename(path)
    with pytest.raises(PolicyError, match="holds no observation"):
        read_observations(path, make())
    with pytest.raises(PolicyError, match="holds no observation"):
        read_observations(tmp_path / "missing.npy", make())


@pytest.mark.parametrize("array", [np.ones((2, 2)), np.ones((2, 2, 3))])
def test_observations_of_another_shape_are_refused(tmp_path: Path, array: Any) -> None:
    np.save(tmp_path / "o.npy", array)
    with pytest.raises(PolicyError, match=r"needs \(B, 3\) or wider"):
        read_observations(tmp_path / "o.npy", make())


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".json"])
def test_observations_of_a_pipe_are_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"pipe{suffix}"
    os.mkfifo(path)
    with pytest.raises(PolicyError, match=r"no observations\.\n  It is a pipe, not a regular"):
        read_observations(path, make())


def test_observations_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(
        PolicyError, match=r"holds no observations\.\n  No such file or directory\n"
    ):
        read_observations(tmp_path / "a.csv", make())


@pytest.mark.parametrize("level", [0, 1, 2])
def test_angles_of_1e308_are_exported(tmp_path: Path, level: int) -> None:
    mpmath = pytest.importorskip("mpmath")
    program = Program.of([Circuit.parse("ry(1e308) ry(theta0) rz(1e308)")], 0, 1)
    encoder = Encoder("arctan", np.zeros(0, dtype=int), np.zeros(0))
    policy = Policy(
        "huge", "any", encoder, program, np.array([-1e300]), np.ones((2, 1)), np.zeros(2)
    )
    export_job(policy, load_device("ideal"), tmp_path / "job", level=level)
    text = (tmp_path / "job" / "round0.qasm").read_text()
    with mpmath.workprec(1500):
        wanted = float(mpmath.cos(mpmath.mpf(1e308) - mpmath.mpf(1e300)))
    z = Simulator(read(text).program).expectation(np.zeros((1, 0)), np.zeros(0))
    assert z[0, 0] == pytest.approx(wanted, abs=1e-12)


def test_values_of_json_are_named_as_json_has_them(tmp_path: Path) -> None:
    policy = load_policy("cartpole")
    for text, found in (("[[1,2,3,null]]", "null"), ("[[1,2,3,true]]", "true")):
        (tmp_path / "o.json").write_text(text)
        with pytest.raises(PolicyError, match=rf"\(found {found}\)"):
            read_observations(tmp_path / "o.json", policy)
