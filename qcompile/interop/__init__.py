"""Circuits of other packages in and out: Qiskit, PennyLane and OpenQASM.

`Program.from_qiskit`, `Program.from_pennylane`, `Program.from_qasm` and `Executable.to_qiskit` are
the doors; those packages are loaded when a door is used.
"""
