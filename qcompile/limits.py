"""Limits that need no other module, so that a command line can name them at no cost."""

MAX_EXECUTIONS_PER_JOB = 10_000_000
"""IBM's limit: circuits after packing times shots."""

MAX_SHOTS = MAX_EXECUTIONS_PER_JOB
"""More shots of one circuit do not fit one job."""

SECONDS_PER_JOB = 2.0
SECONDS_PER_EXECUTION = 0.00035
"""IBM's published estimate of usage: "Workload usage", estimate job run time."""

FREE_SECONDS = 600.0
"""QPU seconds of IBM's Open Plan in 28 days, at no price."""
USD_PER_SECOND = 1.60
"""A third party's figure for the pay-as-you-go plan (May 2026); IBM's own page may differ."""

MAX_QPU_SECONDS = 1e6
"""The largest limit of a live run; eleven days."""

MOST_AHEAD = 64
"""Decisions of an episode that a job measures at most."""

MAX_EPISODES = 10_000
"""Episodes of one run; each keeps an environment alive."""

MAX_FEATURES = 8_000
"""Numbers of an observation that is flattened: more circuits than these take do not fit a file."""

CALIBRATION_HOURS = 24.0
"""A calibration is trusted for so long; IBM's are measured anew every day."""

CLOCK_HOURS = 1.0
"""The clocks of two machines may differ by as much."""

MAX_FILE_BYTES = 64 * 2**20
"""A file that is read whole; a checkpoint may have MAX_CHECKPOINT_BYTES."""

MAX_CHECKPOINT_BYTES = 2**30

MAX_VALUES = 1_000_000
"""Values of one file of plain values, lists and objects among them; an array has no such limit."""
MAX_HISTORY_VALUES = 8 * MAX_VALUES
"""Those of a checkpoint, which remembers four for each episode."""

MAX_KEYS = 10_000
"""Keys of one JSON object."""

MAX_POLICY_GATES = 100_000
"""Gates of all circuits of a policy file."""

MAX_ANGLE_LETTERS = 10_000
"""Letters of one angle of a policy file."""

MAX_QUBITS = 10_000
"""Qubits of a device file, and entries of every other list of it and of a calibration."""
