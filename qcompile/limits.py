"""Limits and prices. This module imports nothing, so the command line can show them at no cost."""

MAX_EXECUTIONS_PER_JOB = 10_000_000
"""IBM's limit on circuits after packing times shots."""

MAX_SHOTS = MAX_EXECUTIONS_PER_JOB
"""The most shots of one circuit that fit in one job."""

SECONDS_PER_JOB = 2.0
SECONDS_PER_EXECUTION = 0.00035
"""IBM's published estimate of usage: "Workload usage", estimate job run time."""

FREE_SECONDS = 600.0
"""Free QPU seconds in 28 days on IBM's Open Plan."""
USD_PER_SECOND = 1.60
"""A third party's figure for the pay-as-you-go plan (May 2026); IBM's own page may differ."""

MAX_QPU_SECONDS = 1e6
"""The largest limit a live run may have: eleven days."""

MOST_AHEAD = 64
"""The most decisions of one episode that one job measures."""

MAX_EPISODES = 10_000
"""The most episodes of one run; each keeps an environment open."""

MAX_FEATURES = 8_000
"""The most numbers in a flattened observation: circuits for more do not fit in a policy file."""

CALIBRATION_HOURS = 24.0
"""Age at which a calibration counts as old; IBM recalibrates every day."""

CLOCK_HOURS = 1.0
"""The most by which the clocks of two machines may differ."""

MAX_FILE_BYTES = 64 * 2**20
"""The largest file that is read, except checkpoints: see MAX_CHECKPOINT_BYTES."""

MAX_CHECKPOINT_BYTES = 2**30

MAX_VALUES = 1_000_000
"""The most values in one JSON file, lists and objects included; arrays have no such limit."""
MAX_HISTORY_VALUES = 8 * MAX_VALUES
"""The same for a checkpoint, which stores four values for each episode."""

MAX_KEYS = 10_000
"""The most keys in one JSON object."""

MAX_POLICY_GATES = 100_000
"""The most gates in a policy file, all circuits together."""

MAX_ANGLE_LETTERS = 10_000
"""The most characters of one angle in a policy file."""

MAX_QUBITS = 10_000
"""The most qubits in a device file, and entries in any other list there or in a calibration."""

MAX_PAULI_QUBITS = 8
"""The most qubits of a circuit whose noise is computed in arrays, 65,536 numbers a row; Aer takes
more."""
MAX_DENSITY_QUBITS = 12
"""The most qubits of a circuit whose noise Aer computes: a density matrix of 256 MB."""

MAX_STATE_QUBITS = 16
"""The most qubits of a circuit whose statevector is computed: without noise, and to train it."""
