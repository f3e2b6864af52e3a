"""For users of Qiskit: transpile once, bind thousands of parameter sets late.

bound = qcompile.qiskit.late(isa_circuit)
sampler.run([bound.pub((isa_circuit, values))])
"""

from qcompile.interop.late import LateCircuit, late

__all__ = ["LateCircuit", "late"]
