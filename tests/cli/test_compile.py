"""`qcompile compile` and `qcompile show`: program files and policies, before and after."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.device import load_device

Call = Callable[..., Any]

PROGRAM = """\
OPENQASM 3.0;
include "stdgates.inc";
qubit[2] q;
bit[2] c;
h q[0];
x q[1];
c = measure q;
"""


@pytest.fixture(autouse=True)
def program() -> None:
    Path("in.qasm").write_text(PROGRAM)


def test_a_program_is_compiled_to_standard_output(qcompile: Call) -> None:
    answer = qcompile("compile", "in.qasm")
    assert (answer.code, answer.err) == (0, "")
    assert (
        answer.out
        == """\
OPENQASM 3.0;
include "stdgates.inc";
qubit[2] q;
bit[2] c;
sx q[0];
x q[1];
c[0] = measure q[0];
c[1] = measure q[1];
"""
    )


def test_a_program_is_compiled_to_a_file(qcompile: Call, left: Call) -> None:
    text = qcompile("compile", "in.qasm").out
    answer = qcompile("compile", "in.qasm", "-o", "new/out.qasm")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out == "2 gates became 2 native gates at level 2 in new/out.qasm\n"
    assert Path("new/out.qasm").read_text() == text
    assert left() == ["in.qasm", "new", "new/out.qasm"]


def test_json_holds_the_text_unless_a_file_does(qcompile: Call) -> None:
    text = qcompile("compile", "in.qasm").out
    assert qcompile("compile", "in.qasm", "--json").json()["text"] == text
    assert qcompile("compile", "in.qasm", "--json", "-o", "out.qasm").json()["text"] is None


def test_notes_stay_off_standard_output(qcompile: Call) -> None:
    Path("in.qasm").write_text(PROGRAM.replace("c = measure q;", "c[0] = measure q[0];"))
    answer = qcompile("compile", "in.qasm", "--json")
    assert answer.code == 0
    assert answer.err == "note: 1 qubit(s) are not measured: their gates are dropped.\n"
    assert answer.json()["level"] == 2


BAD_PROGRAMS = {
    "needs couplings": (
        PROGRAM.replace("x q[1];", "x q[1];\ncx q[0], q[1];"),
        """\
Error: in.qasm:8: ibm_lima has no couplings: it cannot run a circuit on 2 qubits.
  Use a device that has, such as fake_lima; `qcompile backends` lists them.
""",
    ),
    "measures nothing": (
        PROGRAM.replace("c = measure q;", ""),
        """\
Error: in.qasm:6: The program measures nothing, and level 2 keeps only measured qubits.
  Add a measurement, or compile it with --level 1.
""",
    ),
    "too large": (
        PROGRAM.replace("[2]", "[6]"),
        """\
Error: in.qasm:7: The program does not fit ibm_lima.
  It needs 6 qubits at once; ibm_lima has 5 qubits, 5 of them good enough to use.
  Take a larger device, --backend ideal, or split the program.
""",
    ),
}


@pytest.mark.parametrize("what", BAD_PROGRAMS)
def test_bad_programs_are_explained(qcompile: Call, left: Call, what: str) -> None:
    text, error = BAD_PROGRAMS[what]
    Path("in.qasm").write_text(text)
    answer = qcompile("compile", "in.qasm", "--backend", "ibm_lima", "-o", "out.qasm")
    assert (answer.code, answer.out, answer.err) == (1, "", error)
    assert left() == ["in.qasm"]


def test_a_missing_program_is_explained(qcompile: Call) -> None:
    for command in ("compile", "show"):
        answer = qcompile(command, "no.qasm")
        assert (answer.code, answer.out) == (1, "")
        assert (
            answer.err
            == """\
Error: no.qasm: The file cannot be read: No such file or directory.
  Give the path of an OpenQASM 2 or 3 program.
"""
        )


def test_an_output_that_cannot_be_written_is_explained(qcompile: Call, left: Call) -> None:
    answer = qcompile("compile", "in.qasm", "-o", "in.qasm/out.qasm")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Cannot write in.qasm/out.qasm.
  in.qasm is not a folder.
  Choose another path.
"""
    )
    assert left() == ["in.qasm"]


def test_a_policy_is_shown(qcompile: Call, policy: Call) -> None:
    answer = qcompile("show", policy(), "--backend", "ibm_lima")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("tiny for CartPole-v1: 4 circuits, 2 actions, 11 trained numbers")
    assert "h ─ ry(x0) ─ rz(x0) ─ ry(theta0) ─ M" in answer.out


def test_show_answers_with_one_json_document(qcompile: Call, policy: Call) -> None:
    found = qcompile("show", policy(), "--json").json()
    assert set(found) == {
        *("backend", "level", "inputs", "parameters", "rounds", "circuits", "definitions"),
        *("policy", "copies_that_fit", "left_out"),
    }
    assert [circuit["gates"] for circuit in found["circuits"]] == [{"rz": 1, "sx": 2}] * 4
    program = qcompile("show", "in.qasm", "--json").json()
    assert [circuit["source"] for circuit in program["circuits"]] == ["h", "x"]


PHYSICAL = """\
OPENQASM 3.0;
include "stdgates.inc";
bit[2] c;
h $3;
x $1;
c[0] = measure $3;
c[1] = measure $1;
"""


@pytest.mark.parametrize("text", [PROGRAM, PHYSICAL])
def test_show_names_the_qubits_that_compile_writes(qcompile: Call, text: str) -> None:
    Path("in.qasm").write_text(text)
    for backend in ("ibm_lima", "fake_lima"):
        written = qcompile("compile", "in.qasm", "--backend", backend).out
        measured = re.findall(r"^c\[\d\] = measure \$(\d+);$", written, re.MULTILINE)
        shown = qcompile("show", "in.qasm", "--backend", backend, "--json").json()["circuits"]
        assert [str(circuit["qubit"]) for circuit in shown] == measured
        assert len(measured) == 2
        if text is PHYSICAL:
            assert measured == ["3", "1"]


def test_a_physical_qubit_that_is_left_out_is_kept_and_noted(qcompile: Call) -> None:
    Path("in.qasm").write_text(PHYSICAL)
    values = json.loads(load_device("ibm_lima").to_json()) | {"name": "mine", "left_out": [0, 3]}
    Path("mine.json").write_text(json.dumps(values))
    answer = qcompile("compile", "in.qasm", "--backend", "mine.json")
    assert answer.code == 0
    assert answer.err == "note: mine excludes qubit 3, which the program names.\n"
    assert "c[0] = measure $3;" in answer.out


def test_registers_and_physical_qubits_do_not_mix(qcompile: Call, left: Call) -> None:
    Path("in.qasm").write_text("OPENQASM 3.0;\nqubit q;\nU(1, 0, 0) q;\nU(1, 0, 0) $3;\n")
    for command in (("compile", "-o", "out.qasm"), ("show",)):
        answer = qcompile(*command, "in.qasm", "--backend", "ibm_lima", "--level", 1)
        assert (answer.code, answer.out) == (1, "")
        assert (
            answer.err
            == """\
Error: in.qasm:4: The program mixes qubits of a register with physical qubits.
  Use only one kind.
"""
        )
    assert left() == ["in.qasm"]
