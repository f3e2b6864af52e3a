"""Program files, read, compiled and written, beside Qiskit: whole processes, time and memory."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from measure import Row, compared, show, spread

QUBITS = 100
FIXED = ["h", "x", "y", "z", "s", "sdg", "t", "tdg", "sx"]
TURNS = ["rx", "ry", "rz"]

QISKIT = """
import sys
from pathlib import Path
from qiskit import qasm2, transpile
circuit = qasm2.loads(Path(sys.argv[1]).read_text(),
                      custom_instructions=qasm2.LEGACY_CUSTOM_INSTRUCTIONS)
native = transpile(circuit, basis_gates=["rz", "sx", "x"], optimization_level=int(sys.argv[3]))
Path(sys.argv[2]).write_text(qasm2.dumps(native))
"""


def program(gates: int, seed: int) -> str:
    """OpenQASM 2 of `gates` gates on 100 qubits, half of them rotations by random angles."""
    rng = random.Random(seed)
    lines = ["OPENQASM 2.0;", 'include "qelib1.inc";', f"qreg q[{QUBITS}];", f"creg c[{QUBITS}];"]
    for _ in range(gates):
        fixed = rng.random() < 0.5
        name = rng.choice(FIXED if fixed else TURNS)
        angle = "" if fixed else f"({rng.uniform(-4, 4)!r})"
        lines.append(f"{name}{angle} q[{rng.randrange(QUBITS)}];")
    return "\n".join([*lines, "measure q -> c;", ""])


def process(command: Sequence[str]) -> tuple[float, float]:
    """Seconds and peak MB of a whole process."""
    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    assert status == 0, f"{command[0]} ended with {status}"
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def rows() -> list[Row]:
    measured = []
    with tempfile.TemporaryDirectory() as folder:
        source, ours, theirs = (Path(folder) / name for name in ("in.qasm", "a.qasm", "b.qasm"))
        peer = Path(folder) / "peer.py"
        peer.write_text(QISKIT)
        for gates, level, of_qiskit, pairs in ((100_000, 2, 1, 5), (100_000, 0, 0, 3)):
            source.write_text(program(gates, seed=0))
            compile_ = [sys.executable, "-m", "qcompile", "compile", str(source)]
            compile_ += ["--level", str(level), "--format", "qasm2", "-o", str(ours)]
            transpile = [sys.executable, str(peer), str(source), str(theirs), str(of_qiskit)]
            runs = [(process(compile_), process(transpile)) for _ in range(pairs)]
            what = f"read, compile and write {gates:,} gates at level {level}"
            measured.append(
                compared(
                    f"{what}; Qiskit: load, transpile at level {of_qiskit}, dump",
                    [(mine[0], other[0]) for mine, other in runs],
                    "<= 3",
                    slower=True,
                )
            )
            memory = [mine[1] / other[1] for mine, other in runs]
            megabytes = np.median([[mine[1], other[1]] for mine, other in runs], axis=0)
            measured.append(
                spread(
                    f"the same, peak memory ({megabytes[0]:.0f} MB; Qiskit {megabytes[1]:.0f} MB)",
                    memory,
                    "times the memory",
                    "<= 1",
                )
            )
    return measured


if __name__ == "__main__":
    show(rows, "Program files beside Qiskit.")
