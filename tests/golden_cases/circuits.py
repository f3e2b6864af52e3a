"""`qcompile show`, `compile`, `export` and `plan`: programs and policies that do not fit."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from .case import Command
from .inputs import ENCODER, device, policy, without, write

PROGRAM = 'OPENQASM 3.0;\ninclude "stdgates.inc";\nqubit[2] q;\nbit[2] c;\nh q[0];\nx q[1];\n'
MEASURED = f"{PROGRAM}c = measure q;\n"


def many_terms() -> dict[str, object]:
    """A circuit whose surrogate has 3^12 terms."""
    gates = [["h"], *([name, f"x{i}"] for i in range(12) for name in ("ry", "rz"))]
    encoder = ENCODER | {"feature": [0] * 12, "scale": [i + 1.0 for i in range(12)]}
    return policy(encoder=encoder, circuits=[gates], theta=[], weights=[[1.0], [0.0]])


def cancelling() -> dict[str, object]:
    """A circuit that encodes an input so often that the terms of its surrogate cancel."""
    gates = [["ry", "x0"], ["rz", "x0"]] * 40
    encoder = ENCODER | {"feature": [0], "scale": [1.0]}
    return policy(encoder=encoder, circuits=[gates], theta=[], weights=[[1.0], [0.0]])


def npy(array: object) -> bytes:
    file = io.BytesIO()
    np.save(file, np.asarray(array))
    return file.getvalue()


def header(*shape: int) -> bytes:
    """A .npy file without numbers."""
    file = io.BytesIO()
    values = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, values)
    return file.getvalue()


OBSERVATIONS = {
    "3.csv": "1,2,3\n",
    "nan.csv": "1,2,3,nan\n",
    "words.csv": "# mean\n1,2,3,4\n\n3,x,1,1\n",
    "uneven.csv": "1,2,3,4\n3,4,5\n",
    "comma.csv": "1,\n",
    "empty.csv": "",
    "utf-16.csv": "1,2,3,4".encode("utf-16"),
    "uneven.json": "[[1, 2, 3, 4], [1]]",
    "text.json": '["a"]',
    "object.json": '{"a": 1}',
    "number.json": "3",
    "cut.json": "[[1, 2",
    "cut.npy": npy(np.zeros((1, 4)))[:-8],
    "text.npy": "1,2,3,4",
    "words.npy": npy(["a", "b"]),
    "complex.npy": npy([1j]),
    "vast.npy": header(0, 2**62, 2**62),
    "cube.npy": npy(np.zeros((1, 2, 4))),
}


def files() -> None:
    write(OBSERVATIONS)
    write(
        {
            "huge.csv": "1e308,1e308,1e308,1e308\n",
            "tiny.json": policy(),
            "huge.json": policy(encoder=ENCODER | {"function": "identity", "scale": [1e9] * 4}),
            "terms.json": many_terms(),
            "cancelling.json": cancelling(),
            "in.qasm": MEASURED,
            "half.qasm": f"{PROGRAM}c[0] = measure q[0];\n",
            "unmeasured.qasm": PROGRAM,
            "six.qasm": MEASURED.replace("[2]", "[6]"),
            "cx.qasm": MEASURED.replace("x q[1];", "cx q[0], q[1];"),
            "mixed.qasm": "OPENQASM 3.0;\nqubit q;\nU(1, 0, 0) q;\nU(1, 0, 0) $3;\n",
            "high.qasm": 'OPENQASM 3.0;\ninclude "stdgates.inc";\nbit c;\nx $9;\nc = measure $9;\n',
            "third.qasm": (
                'OPENQASM 3.0;\ninclude "stdgates.inc";\nbit c;\nx $3;\nc = measure $3;\n'
            ),
            "marks.qasm": MEASURED.replace("h q[0];", "h q[0];\nbarrier q;\ndelay[10ns] q[1];"),
            "pragma.qasm": f"{MEASURED}#pragma braket result probability q[0]\n",
            "barrier.qasm": MEASURED.replace(
                "qubit[2] q;", "gate g a { x a; barrier a; }\nqubit[2] q;\ng q[0];"
            ),
            "inputs.qasm": "OPENQASM 3.0;\ninput float a;\nqubit q;\nbit c;\nrx(a) q;\n"
            "c = measure q;\n",
            "named.qasm": 'OPENQASM 2.0;\ninclude "qelib1.inc";\nqreg in[1];\ncreg c[1];\n'
            "x in[0];\nmeasure in -> c;\n",
            "utf-16.qasm": "qubit q;".encode("utf-16"),
            "mine.json": device(left_out=[0, 3]),
            "file": "",
            "job/mine": "",
        }
    )
    Path("folder.qasm").mkdir()


COMPILE, EXPORT = "compile in.qasm", "export tiny.json --out new"

CASES = (
    "compile",
    "compile no.qasm",
    "compile folder.qasm",
    "compile utf-16.qasm",
    "compile cx.qasm",
    "compile unmeasured.qasm",
    "compile six.qasm --backend ibm_lima",
    "compile mixed.qasm --backend ibm_lima --level 1",
    "compile high.qasm --backend ibm_lima",
    "compile in.qasm --backend ibm_lime",
    "compile in.qasm --level 3",
    "compile in.qasm --format qasm4",
    "compile inputs.qasm --format qasm2",
    "compile in.qasm -o file/out.qasm",
    Command("compile in.qasm", "without the parser", without("openqasm3.parser")),
    *(
        f"compile {name}.qasm -o out.qasm"
        for name in ("half", "marks", "pragma", "barrier", "named")
    ),
    "compile marks.qasm --level 0 -o out.qasm",
    "compile third.qasm --backend mine.json -o out.qasm",
    "show no.qasm",
    "show cx.qasm",
    "show in.qasm --surrogate",
    "show tiny.json --surrogate --backend ibm_lima",
    "show tiny.json --surrogate --level 2",
    "show tiny.json --surrogate --draw a.svg",
    "show tiny.json --draw a.png",
    "show tiny.json --draw a.svg --circuit 9",
    "show tiny.json --circuit 1",
    "show terms.json --surrogate",
    "show cancelling.json --surrogate",
    "export nosuch",
    "export tiny.json --out job",
    "export tiny.json --out file",
    "export tiny.json --out file/job",
    f"{EXPORT} --backend nosuch",
    f"{EXPORT} --format qasm2",
    f"{EXPORT} --shots exact",
    f"{EXPORT} --shots 0",
    f"{EXPORT} --observations no.csv",
    f"{EXPORT} --observations .",
    *(f"{EXPORT} --observations {name}" for name in OBSERVATIONS),
    "export huge.json --out new --observations huge.csv",
    "plan nosuch",
    "plan tiny.json --backend ideal",
    "plan tiny.json --backend nosuch",
    "plan tiny.json --shots exact",
    "plan tiny.json --episodes 0",
    "plan tiny.json --mitigation magic",
    "plan tiny.json --usd-per-second -1",
    "plan tiny.json --usd-per-second nan",
    "plan tiny.json --account mine",
    "plan tiny.json --instance mine",
    "plan tiny.json --within 60",
    "plan tiny.json --within 0",
    "plan tiny.json --within 60 --keep 1.1",
    "plan tiny.json --keep 0.9",
    "plan tiny.json cartpole",
    "plan acrobot cartpole --within 60",
)
