"""Programs that are refused: their syntax, names, gates and measurements."""

from __future__ import annotations

from .case import Program
from .inputs import setting

HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\nqreg q[2];\ncreg c[2];\n'

SYNTAX = (
    "",
    "// nothing\n",
    "OPENQASM 3.0;\n",
    "OPENQASM 4.0;\nqubit q;\n",
    "OPENQASM 3;\nOPENQASM 3;\nqubit q;\n",
    "qubit q;\nOPENQASM 3.0;\nx q;\n",
    'include "mine.inc";\n',
    "qubit q\nx q;\n",
    "qubit q;\nx q",
    "qubit q;\n/* x q;\n",
    "qubit q;\nx q q;\n",
    "qubit q;\nx q[0;\n",
    "qubit q;\nrx(0.5 q;\n",
    "qubit q;\nrx(1 + ) q;\n",
    "qubit q;\n€ q;\n",
    "qubit q;\nrx(0b) q;\n",
    "qubit q;\n@ x q;\n",
    "OPENQASM 3.0;\nqubit in;\n",
    "qubit q;\nrx(" + "x" * 5000 + ") q;\n",
    "qubit q;\nrx(" + "(" * 2000 + "1" + ")" * 2000 + ") q;\n",
    f"{HEAD}qubit q[2];\n",
    f"{HEAD}bit  c [n+1] ;\n",
    f"{HEAD}qubit $0;\n",
    f"{HEAD}int n[32] = 4;\n",
    f"{HEAD}const n = 3;\n",
    f"{HEAD_2}x q[0]\nx q[1];\n",
    f"{HEAD_2}gate g(a b {{ }}\n",
    f"{HEAD_2}sxx q[0];\n",
    "qubit q;\n#pragma braket unitary([[0, 1], [1, 0]]) q\n",
    'qubit q;\ninclude "\x1b[31mred\u202e";\n',
)

UNSUPPORTED = tuple(
    f"qubit q;\n{statement}\n"
    for statement in (
        "while (true) { x q; }",
        "bit c;\nif (c == 1) {\n  x q;\n}",
        "extern f(float) -> bit;",
        "box[2.5ns] { x q; }",
        "cal { }",
        "defcal x $0 { }",
        'defcalgrammar "openpulse";',
        "input int n;",
        "output float f;",
        "end;",
        "{ x q; }",
        "stretch s;",
        "delay[unknown] q;",
        "delay[1e999s] q;",
        "switch (1) { case 1 { x q; } }",
        "complex z = 1im;",
        "array[int, 2] a = {1, 2};",
        "bit[2] c;\nc[0] = 1;",
        "1 + 1;",
        "gate g a { reset a; }\ng q;",
        "gate g a { if (true) { x a; } }\ng q;",
    )
)

NAMES = (
    "qubit[2] q;\nx r[0];\n",
    "x r;\n",
    "qubit q;\nbit q;\n",
    "qubit q;\nbit c;\nx c;\n",
    "qubit q;\nmeasure q -> q;\n",
    "qubit[2] q;\nx q[2];\n",
    "qubit[2] q;\nx q[-3];\n",
    "qubit[2] q;\nx q[0, 1];\n",
    "qubit q;\nx q[0][0];\n",
    "qubit[4] q;\nx q[0:0:3];\n",
    "qubit[2] q;\nx q[0.5];\n",
    "qubit[2] q;\nbit c;\nlet a = q ++ c;\n",
    "qubit[2] q;\nlet a = q ++ q[0:0];\n",
    "let a = 1;\n",
    "qubit[1000000000] q;\n",
    "qubit[0] q;\n",
    "qubit[1/0] q;\n",
    "input float theta;\nqubit q;\nrx(thta) q;\n",
    "qubit q;\nrx(nothing) q;\n",
    "x $99999999999;\n",
    "qubit[2] q;\nqubit[3] r;\ngate two a, b { x a; x b; }\ntwo q, r;\n",
    "qubit[2] q;\ngate two a, b { x a; x b; }\ntwo q[0], q[0];\n",
)

GATES = (
    "qubit q;\nsxgd q;\n",
    "qubit q;\nnothing q;\n",
    "qubit q;\nrx q;\n",
    "qubit q;\nu3(1, 2) q;\n",
    "qubit q;\nh(1) q;\n",
    "qubit[2] q;\nh q[0], q[1];\n",
    "gate g(a) b { rx(a) b; }\nqubit[2] q;\ng(1) q[0], q[1];\n",
    "gate g(a) b { rx(a) b; }\nqubit q;\ng q;\n",
    "gate g(a) b {\n  rx(a) b;\n  ry(c) b;\n}\nqubit q;\ng(1) q;\n",
    "gate g a {\n  x b;\n}\nqubit q;\ng q;\n",
    "gate g a, b {\n  cx a, a;\n}\nqubit[2] q;\ng q[0], q[1];\n",
    "gate g a, a { x a; }\nqubit q;\n",
    "gate g a {\n  x a;\n  g a;\n}\nqubit q;\ng q;\n",
    f"{HEAD_2}opaque magic(a, b) r;\nmagic(1, 2) q[0];\n",
    "qubit q;\nx[2ns] q;\n",
    "qubit[2] q;\nbit[2] c;\nh q;\n// comment\ncx q[0],q[1];\n",
    "gate bell a, b { h a; CX a, b; }\nqubit[3] q;\nbell q[0], q[1];\nctrl @ x q[0], q[1];\n"
    "ccx q[0], q[1], q[2];\n",
    "qubit[3] q;\nccx q[0], q[1], q[2];\n",
    "qubit[2] q;\nswap q[0], q[1];\n",
    "qubit[2] q;\nRZZ(0.2) q[0], q[1];\n",
    f"{HEAD}input float x;\nqubit q;\npow(0.5) @ U(x, 0, 0) q;\n",
    f"{HEAD}input float x;\nqubit q;\npow(x) @ rx(1) q;\n",
    f"{HEAD}gate both a, b {{ x a; h b; }}\nqubit[2] q;\npow(0.5) @ both q[0], q[1];\n",
    f"{HEAD}qubit q;\nctrl @ x q;\n",
    f"{HEAD}qubit q;\nctrl(2) @ gphase(1) q;\n",
    f"{HEAD}qubit q;\npow(1000000000) @ x q;\n",
    "\n".join(
        (
            "gate g0 a { x a; }",
            *(f"gate g{i} a {{ g{i - 1} a; g{i - 1} a; }}" for i in range(1, 60)),
        )
    )
    + "\nqubit q;\ng59 q;\n",
)

MEASUREMENTS = (
    "qubit[2] q;\nbit[2] c;\nc = measure q;\nx q[1];\n",
    "qubit[2] q;\nbit[2] c;\nc[0] = measure q[0];\nc[0] = measure q[1];\n",
    "qubit[2] q;\nbit[3] c;\nc = measure q;\n",
    "qubit q;\nx q;\nreset q;\n",
    "qubit q;\nbit c;\nc = measure q;\nreset q;\n",
    'qubit q;\nbit[2] b = "01";\n',
)


def files() -> None:
    """They need none."""


CASES = (
    *map(Program, (*SYNTAX, *UNSUPPORTED, *NAMES, *GATES, *MEASUREMENTS)),
    Program(
        "qubit q;\nrx(1+1+1+1+1+1+1+1) q;\n",
        "with statements of ten characters at most",
        setting("qcompile.qasm.parse.LONGEST_STATEMENT", 10),
    ),
    Program(
        "qubit[50] q;\nbarrier q;\nbarrier q;\nbarrier q;\n",
        "with 100 marked qubits at most",
        setting("qcompile.qasm.interpreter.MAX_MARKED", 100),
    ),
)
