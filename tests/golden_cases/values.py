"""Programs that are refused: their angles, constants, variables, loops and subroutines."""

from __future__ import annotations

from .case import Program
from .inputs import setting

ANGLES = (
    "input float x;\nqubit q;\nrx(x*x) q;\n",
    "input float x;\nqubit q;\nrx(sin(x)) q;\n",
    "qubit q;\nrx(1/0) q;\n",
    "qubit q;\nrx(10.0**400) q;\n",
    "qubit q;\nrx(sqrt(-1)) q;\n",
    "qubit q;\nrx(2**100000) q;\n",
    "const int n = 1;\nqubit q;\nrx(n/2*pi) q;\n",
    "qubit q;\nrx(pi^2) q;\n",
    "qubit q;\nrx(2ns) q;\n",
    "qubit q;\nrx(sizeof(q)) q;\n",
    "qubit q;\nrx(nope(1)) q;\n",
    "qubit q;\nrx(sin(1, 2)) q;\n",
    "bool a = true;\nqubit q;\nrx(a) q;\n",
    "angle a = pi;\nqubit q;\nrx(a / -2) q;\n",
)

VARIABLES = (
    "int[8] a = 200;\n",
    "uint a = -1;\n",
    "int a = 2.5;\n",
    "angle a = pi;\nint n = a;\n",
    "uint[8] a = 3;\nqubit q;\nrx(a - 5) q;\n",
    "float a;\nqubit q;\nrx(a) q;\n",
    "b = 2;\n",
    "const float a = 1;\na = 2;\n",
    "input float x;\nangle a = x;\n",
    "input float x;\nconst float a = x;\n",
    "const float a = b;\n",
    "float[8] a = 1;\n",
    "int[2000] a = 1;\n",
    "int[n] a = 1;\n",
    'bit[4] b = "0100";\n',
    'const bit[4] b = "0100";\nuint[8] a = b;\n',
    'const bit[4] b = "0100";\nangle[8] a = b;\n',
    "uint[4] a = 3;\nbit[2] b = a;\n",
    "angle[4] a = pi;\nint[4] b = int[4](a);\n",
    "angle a = 1;\nangle b = 2;\na /= b * pi;\n",
    "bool a = true;\na += 1;\n",
    "float v = 1;\ngate g a { rz(v) a; }\nqubit q;\ng q;\n",
)

BLOCKS = (
    "qubit q;\nfor uint i in [0:2] {\n  h q;\n  nope q;\n}\n",
    "qubit[2] q;\nfor uint i in [0:2] h q[i];\n",
    "qubit q;\nint i;\nfor uint i in [0:1] h q;\n",
    "qubit q;\nfor uint i in [0:0:1] h q;\n",
    "qubit[2] q;\nfor uint i in q h q[0];\n",
    "qubit q;\nfor uint i in [0:1] { int k = i; }\nrx(k) q;\n",
    "def f(qubit a) {\n  f(a);\n}\nqubit q;\nf(q);\n",
    "def f(qubit a, float t) { x a; }\nqubit q;\nf(q);\n",
    "def f(qubit[2] a) { x a; }\nqubit[3] q;\nf(q);\n",
    "def f(creg c[3]) { }\nbit[3] c;\nqubit q;\nf(c);\n",
    "def f(qubit a) -> bit { return measure a; }\nqubit q;\nf(q);\n",
    "def f(bool b, qubit a) { x a; }\nqubit q;\nf(0.5, q);\n",
    "def f(complex b, qubit a) { x a; }\nqubit q;\nf(1, q);\n",
    "def f(qubit a) {\n  x a;\n  nope a;\n}\nqubit q;\nf(q);\n",
    "float v = 1;\nqubit q;\ndef f(qubit a) {\n  v = 2;\n  rz(v) a;\n}\nf(q);\n",
)


def files() -> None:
    """They need none."""


FEW = ("with 1000 gates at most", setting("qcompile.qasm.work.MAX_GATES", 1000))

CASES = (
    *map(Program, (*ANGLES, *VARIABLES, *BLOCKS)),
    Program("qubit q;\nfor uint i in [0:99999999999] { }\n", *FEW),
    Program("qubit[100] q;\nfor uint i in [0:999999] { x q; }\n", *FEW),
)
