"""Program files with circuits of several qubits, compiled, and read back by Qiskit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm2, qasm3
from several import measured, random_qiskit

from qcompile.device import IDEAL, Device, load_device
from qcompile.errors import CircuitError, DeviceError
from qcompile.ir import Circuit
from qcompile.jobs.program_file import CompiledFile, compile_source
from qcompile.passes import LEVELS
from qcompile.passes.route import Routed
from qcompile.qasm import read

HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
PHYSICAL = re.compile(r"^(\w+)(?:\(.*\))? \$(\d+)(?:, \$(\d+))?;$", re.MULTILINE)


def one_way(device: Device) -> Device:
    """The device with ecr in one direction of every pair, as machines had it."""
    pairs = {tuple(sorted(each.qubits)): each for each in device.couplings}
    couplings = [each.model_copy(update={"gate": "ecr"}) for each in pairs.values()]
    values = device.model_dump() | {"name": "one_way", "couplings": couplings}
    return Device.model_validate(values)


DEVICES = {
    "ideal": IDEAL,
    "one_way": one_way(load_device("fake_jakarta")),
    **{name: load_device(name) for name in ("fake_lima", "fake_jakarta", "fake_fez")},
}


def compiled(text: str, device: str = "ideal", level: int = 2, version: str = "3") -> CompiledFile:
    return compile_source(read(text, "p"), DEVICES[device], level, version)  # type: ignore[arg-type]


def reader(text: str) -> QuantumCircuit:
    return qasm2.loads(text) if text.startswith("OPENQASM 2") else qasm3.loads(text)


def native_names(text: str, device: Device) -> set[str]:
    """The names of gates in a text, each of which the device has where it is used."""
    names = set()
    for name, first, second in PHYSICAL.findall(text):
        names.add(name)
        if name == "barrier":
            continue
        if second:
            assert (name, int(first), int(second)) in device.coupling_calibrations
        else:
            assert name in (*device.native.gates, "id")
    return names


def random_file(seed: int) -> QuantumCircuit:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    circuit = QuantumCircuit(count, count)
    circuit.compose(random_qiskit(rng, count), inplace=True)
    some = int(rng.integers(1, count + 1))
    circuit.measure(*(rng.choice(count, some, False).tolist() for _ in range(2)))
    return circuit


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("device", DEVICES)
def test_the_result_measures_what_the_file_measures(device: str, level: int) -> None:
    for seed in range(4):
        source = random_file(seed)
        bits, wanted = measured(source)
        for version in ("3", "2"):
            text = qasm3.dumps(source) if seed % 2 else qasm2.dumps(source)
            made = compiled(text, device, level, version)
            found_bits, found = measured(reader(made.text))
            assert found_bits == bits
            np.testing.assert_allclose(found, wanted, atol=1e-9)
            if version == "3" and device != "ideal":
                native_names(made.text, DEVICES[device])


STAR = HEAD + (
    "qubit[4] q;\nbit[4] c;\nry(0.3) q;\ncx q[0], q[1];\ncx q[1], q[2];\ncx q[2], q[0];\n"
    "x q[3];\nc[0] = measure q[2];\nc[2] = measure q[3];\n"
)


def test_registers_bits_and_numbers_are_kept() -> None:
    made = compiled(STAR, "fake_lima")
    assert made.circuits == (0, 3)
    assert made.executable.source.measured == ((2,), (3,))
    lines = made.text.splitlines()
    assert lines[2] == "bit[4] c;"
    qubits = made.executable.bit_qubits
    assert lines[-2:] == [f"c[0] = measure ${qubits[2]};", f"c[2] = measure ${qubits[3]};"]
    assert made.notes == ()
    alone = compiled(STAR)
    assert alone.text.splitlines()[2:4] == ["qubit[4] q;", "bit[4] c;"]


def test_a_circuit_of_which_nothing_is_measured_is_dropped_at_level_2() -> None:
    text = HEAD + "qubit[5] q;\nbit c;\nh q;\ncx q[0], q[1];\ncx q[3], q[4];\nc = measure q[1];\n"
    made = compiled(text)
    assert made.circuits == (0,)
    assert made.notes == ("3 qubit(s) are not measured: their gates are dropped.",)
    assert compiled(text, level=1).circuits == (0, 2, 3)
    bits, wanted = measured(reader(text))
    np.testing.assert_allclose(measured(reader(made.text))[1], wanted, atol=1e-12)
    assert bits == [0]


def test_openqasm_2_says_where_every_qubit_goes() -> None:
    text = STAR.replace("c[2] = measure q[3];", "cx q[3], q[0];")
    made = compiled(text, "fake_lima", version="2")
    places = made.executable.qubits.tolist()
    names = [f"q[{i}]" for i in range(4)] + [f"passed[{i}]" for i in range(len(places) - 4)]
    pairs = ", ".join(f"{name} on {place}" for name, place in zip(names, places, strict=True))
    assert made.notes == (f"OpenQASM 2 cannot name physical qubits: place {pairs}.",)


def over_a_third(circuit: Circuit, *_: object, **__: object) -> Routed:
    """`h q[0]; cx q[0], q[1];` on qubits 1 and 3 of fake_lima, of which 1 then goes to 0."""
    assert str(circuit) == "h@0 cx@0,1"
    return Routed(Circuit.parse("h@2 cx@2,1 cx@2,0 cx@0,2 cx@2,0", 3), np.array([0, 3, 1]))


@pytest.mark.parametrize("version", ["3", "2"])
@pytest.mark.parametrize("level", LEVELS)
def test_qubits_that_are_passed_through_have_a_register_of_their_own(
    monkeypatch: pytest.MonkeyPatch, level: int, version: str
) -> None:
    monkeypatch.setattr("qcompile.passes.place_wide.route", over_a_third)
    text = HEAD + (
        "qubit[2] q;\nqubit passed;\nbit[3] c;\nh q[0];\nx passed;\ncx q[0], q[1];\n"
        "c[2] = measure q[1];\nc[0] = measure q[0];\nc[1] = measure passed;\n"
    )
    made = compiled(text, "fake_lima", level, version)
    assert made.executable.native.widths == (3, 1)
    assert made.executable.bit_qubits.tolist() == [0, 3, 2]
    if version == "2":
        words = "place q[0] on 0, q[1] on 3, passed_[0] on 1, passed[0] on 2"
        assert made.notes == (f"OpenQASM 2 cannot name physical qubits: {words}.",)
        assert "qreg passed_[1];" in made.text
    else:
        native_names(made.text, DEVICES["fake_lima"])
    bits, found = measured(reader(made.text))
    assert bits == [0, 1, 2]
    np.testing.assert_allclose(found, measured(reader(text))[1], atol=1e-9)


NAMED = HEAD + (
    "bit[3] c;\nry(0.4) $0;\nry(0.3) $1;\ncx $0, $1;\nswap $1, $3;\nh $3;\nrx(0.7) $1;\n"
    "c[0] = measure $0;\nc[1] = measure $1;\nc[2] = measure $3;\n"
)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("device", ["fake_lima", "one_way", "ideal"])
def test_physical_qubits_are_kept(device: str, level: int) -> None:
    made = compiled(NAMED, device, level)
    assert made.executable.qubits.tolist() == [0, 1, 3]
    measurements = [f"c[{bit}] = measure ${qubit};" for bit, qubit in enumerate((0, 1, 3))]
    assert made.text.splitlines()[-3:] == measurements
    np.testing.assert_allclose(
        measured(reader(made.text))[1], measured(reader(NAMED))[1], atol=1e-9
    )
    if device != "ideal":
        native_names(made.text, DEVICES[device])


@pytest.mark.parametrize(
    ("text", "device", "message"),
    [
        (
            NAMED.replace("$3", "$4"),
            "fake_lima",
            "p:12: fake_lima does not couple qubits 1 and 4, which cx connects.\n"
            "  It couples 0-1 1-2 1-3 3-4.\n"
            "  Name coupled qubits, or declare a register: its qubits are placed for you.",
        ),
        (
            NAMED.replace("$3", "$9"),
            "fake_lima",
            "p:12: The program does not fit fake_lima.\n"
            "  It needs qubit $9; fake_lima has 5 qubits, 5 of them good enough to use.\n"
            "  Take a larger device, --backend ideal, or split the program.",
        ),
        (
            NAMED.replace("$3", "q").replace("bit[3]", "qubit q;\nbit[3]"),
            "fake_lima",
            "p:13: The program mixes qubits of a register with physical qubits.\n"
            "  Use only one kind.",
        ),
        (
            HEAD + "qubit[6] q;\nbit[6] c;\ncx q[0:4], q[1:5];\nc = measure q;\n",
            "fake_lima",
            "p:6: A circuit has 6 qubits, fake_lima has 5.\n  Use a larger device.",
        ),
        (
            HEAD + "qubit[6] q;\nbit[6] c;\nh q;\ncx q[0], q[1];\nc = measure q;\n",
            "fake_lima",
            "p:7: The program does not fit fake_lima.\n"
            "  It needs 6 qubits at once; fake_lima has 5 qubits, 5 of them good enough to use.\n"
            "  Take a larger device, --backend ideal, or split the program.",
        ),
    ],
)
def test_what_does_not_fit_is_refused(text: str, device: str, message: str) -> None:
    with pytest.raises((CircuitError, DeviceError)) as caught:
        compiled(text, device, 1)
    assert str(caught.value) == message


def test_a_physical_qubit_that_is_left_out_is_kept_and_noted() -> None:
    values = load_device("fake_lima").model_dump() | {"name": "mine", "left_out": [0, 3]}
    device = Device.model_validate(values)
    made = compile_source(read(NAMED), device, 2, "3")
    assert made.notes == ("mine excludes qubit 0, 3, which the program names.",)
    assert made.executable.qubits.tolist() == [0, 1, 3]


def lines(widths: tuple[int, ...], last: str = "") -> str:
    """Chains of so many qubits side by side, with something more at the end."""
    count = sum(widths)
    text = HEAD + f"qubit[{count}] q;\nbit[{count}] c;\nry(0.3) q;\n"
    first = 0
    for width in widths:
        for qubit in range(first, first + width - 1):
            text += f"cx q[{qubit}], q[{qubit + 1}];\nry(0.2) q[{qubit + 1}];\n"
        first += width
    return f"{text}{last}c = measure q;\n"


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("widths", [(2, 5), (2, 2, 3), (2, 2, 2)])
def test_circuits_without_room_one_by_one_are_placed_as_one(
    widths: tuple[int, ...], level: int
) -> None:
    """fake_jakarta is an H of 7 qubits: the best pair leaves no room for the others."""
    text = lines(widths, "barrier q;\nry(0.5) q;\ncx q[0], q[1];\n")
    made = compiled(text, "fake_jakarta", level)
    assert made.executable.source.widths == (sum(widths),)
    assert made.circuits == (0,)
    np.testing.assert_allclose(measured(reader(made.text))[1], measured(reader(text))[1], atol=1e-9)
    assert made.text.count("barrier") == (level == 0)
