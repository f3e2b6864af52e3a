"""Conversion of circuits from and to Qiskit, PennyLane and OpenQASM.

The entry points are `Program.from_qiskit`, `Program.from_pennylane`, `Program.from_qasm` and
`Executable.to_qiskit`; each loads the package it needs when it is called.
"""
