"""States of circuits on several qubits."""
