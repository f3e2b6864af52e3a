"""The executor that runs circuits through a Qiskit sampler, by default Aer with a backend's noise.

Source: qiskit.primitives, SamplerV2 and BitArray; qiskit_aer.noise.device for the noise.
"""

from __future__ import annotations

import warnings
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.device import Device, Kind
from qcompile.errors import DeviceError, MissingExtraError, QcompileError
from qcompile.execution.executor import Executor, check_device
from qcompile.execution.packed import (
    REGISTER,
    Couplings,
    PackedExecutable,
    PackedRound,
    count_odd,
    pack_round,
)
from qcompile.execution.prepared import Binomial, Prepared, largest_shots
from qcompile.passes import Executable
from qcompile.snapshot import device_from_backend, properties_of
from qcompile.terminal import first_line

_SIMULATORS = (
    "qiskit_aer.",
    "qiskit_ibm_runtime.fake_provider.",
    "qiskit.providers.basic_provider.",
    "qiskit.providers.fake_provider.",
    "qiskit.primitives.statevector_sampler.",
)
"""The modules that define samplers and backends which simulate."""
_WIDEST_DENSITY_MATRIX = 9
"""Up to this many qubits, a density matrix is faster than a state per shot."""


class PrimitiveExecutor(Executor):
    """Runs executables on `backend`, a Qiskit BackendV2 or its Device, through a SamplerV2.

    Every call is one job with one pub for each round, whose circuits are side by side on their
    physical qubits, and whose angles are arrays over the observations. Without a `sampler` the job
    runs on this machine: qiskit-ibm-runtime's SamplerV2 simulates the noise of `device`, the
    calibration of the backend, in Aer, including asymmetric readout. The same seed and the same
    calls then give the same counts. A `sampler` (any object with the `run` of SamplerV2) has its
    own noise and seed; it should accept the native gates of `backend` on all of its qubits. It is
    required if `backend` is a Device. `kind` is by default that of `sampler_kind`.

    Raises:
        DeviceError: the backend cannot be turned into a device, or a Device has no sampler.
        MissingExtraError: Qiskit, Aer or qiskit-ibm-runtime is not installed.
    """

    def __init__(
        self,
        backend: Any,
        *,
        sampler: Any = None,
        seed: int | np.random.SeedSequence | None = None,
        kind: Kind | None = None,
    ):
        if isinstance(backend, Device) and sampler is None:
            raise DeviceError(
                f"{backend.name} is a Device, which needs sampler=.",
                "OfflineExecutor(device) runs its noise model.",
            )
        self.device = backend if isinstance(backend, Device) else device_from_backend(backend)
        self.kind: Kind = sampler_kind(sampler, backend) if kind is None else kind
        self.rng = np.random.default_rng(seed)
        self._backend, self._sampler = backend, sampler
        self._simulator: Any = _simulator(backend, self.device) if sampler is None else None
        self._coupled_simulators: dict[Couplings, Any] = {}

    def prepare(self, executable: Executable) -> Prepared:
        """The executable with its rounds as circuits.

        Raises:
            DeviceError: the executable was compiled for another device.
        """
        check_device(executable, self.device)
        return _PreparedSampler(executable, self)

    @property
    def simulates(self) -> bool:
        """Whether it simulates by itself, without a sampler of the user's."""
        return self._sampler is None

    def bits(
        self, rounds: list[PackedRound], angles: FloatArray, shots: int
    ) -> list[NDArray[np.uint8]]:
        """The packed bits of each round from one job, (B, shots, bytes) each.

        Raises:
            DeviceError: the sampler refuses the job or fails; the message quotes it.
            QcompileError: raised by a sampler of qcompile, such as that of a live run.
        """
        from qiskit.exceptions import QiskitError

        try:
            sampler = self._sampler
            if sampler is None:
                sampler = self._simulation(rounds)
            pubs = [packed.pub(angles) for packed in rounds]
            result = sampler.run(pubs, shots=shots).result()
            bits = [np.asarray(getattr(pub.data, REGISTER).array) for pub in result]
        except QcompileError:
            raise
        except (QiskitError, ValueError, OSError) as error:
            words = getattr(error, "message", None) or str(error)
            raise DeviceError(
                f"The sampler of {self.device.name} did not run the job.",
                *filter(None, [first_line(str(words))]),
                f"The job had {len(rounds)} circuits, {len(angles)} observations, {shots} shots.",
            ) from error
        for of_round in bits:
            if of_round.shape[:2] != (len(angles), shots):
                raise DeviceError(
                    f"The sampler of {self.device.name} gave bits of shape {of_round.shape[:2]}.",
                    f"Expected {(len(angles), shots)}: observations, shots.",
                )
        return bits

    def _simulation(self, rounds: list[PackedRound]) -> Any:
        """A sampler with a new seed, for a job with these rounds."""
        from qiskit_ibm_runtime import SamplerV2

        simulator = self._simulator_of(frozenset().union(*(each.couplings for each in rounds)))
        dense = max(packed.qubits for packed in rounds) <= _WIDEST_DENSITY_MATRIX
        simulator.set_options(method="density_matrix" if dense else "matrix_product_state")
        seed = int(self.rng.integers(1, 2**31))  # the runtime treats 0 as no seed
        with warnings.catch_warnings():
            # Its successor in 0.51 gives every pub the same seed, so rounds would be dependent.
            warnings.simplefilter("ignore", DeprecationWarning)
            return SamplerV2(mode=simulator, options={"simulator": {"seed_simulator": seed}})

    def _simulator_of(self, couplings: Couplings) -> Any:
        """The simulator for circuits with these couplings, of which only those have noise.

        The noise of all couplings of a large machine would take seconds a job, because the sampler
        copies it. Circuits without couplings keep their own simulator.
        """
        if not couplings:
            return self._simulator
        if couplings not in self._coupled_simulators:
            made = _simulator(self._backend, self.device, couplings)
            self._coupled_simulators[couplings] = made
        return self._coupled_simulators[couplings]


class _PreparedSampler(PackedExecutable):
    def __init__(self, executable: Executable, executor: PrimitiveExecutor):
        super().__init__(executable)
        self._executor = executor
        self.shots_only = (
            f"{executor.device.name} runs through a sampler, which needs shots.",
            "Give a number of shots, for example 8192.",
            "For expectations without shot noise use a device of `qcompile backends`.",
        )

    @cached_property
    def rounds(self) -> list[PackedRound]:
        """The rounds as circuits; for our own simulator wide ones in parts that it plays fast."""
        executable = self.executable
        if self._executor.simulates and executable.source.is_wide:
            executable = _in_small_rounds(executable)
        return [pack_round(executable, k) for k in range(executable.round_count)]

    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        most = largest_shots(shots)
        angles = self.executable.bind(x, theta)
        program = self.executable.source
        if not len(angles) or not len(program):
            return np.zeros((len(angles), len(program.measured)), dtype=np.int64)
        bits = self._executor.bits(self.rounds, angles, most)
        return count_odd(program, self.rounds, bits, shots)


def _in_small_rounds(executable: Executable) -> Executable:
    """The executable in more rounds, of few enough qubits for a density matrix where that can be.

    Circuits of a round share no qubits, so that their counts have the same law.
    """
    rounds, widths = np.empty_like(executable.rounds), executable.native.widths
    number = -1
    for index in range(executable.round_count):
        room = 0
        for circuit in np.flatnonzero(executable.rounds == index).tolist():
            if widths[circuit] > room:
                number, room = number + 1, _WIDEST_DENSITY_MATRIX
            rounds[circuit] = number
            room -= widths[circuit]
    return replace(executable, rounds=rounds)


def sampler_kind(sampler: Any, backend: Any) -> Kind:
    """The kind of the counts of a sampler for `backend`: "noise-model" or "hardware".

    They come from a noise model if there is no sampler, if the sampler simulates by itself, or if
    its backend (by default `backend`) is a simulator or a fake backend of Aer, Qiskit or
    qiskit-ibm-runtime, including its local testing mode. Anything else may be a paid machine, and
    counts as hardware.
    """
    sampler_backend = getattr(sampler, "backend", None)
    sampler_backend = sampler_backend() if callable(sampler_backend) else sampler_backend
    simulated = sampler is None or _is_simulator(sampler)
    return (
        "noise-model"
        if simulated or _is_simulator(backend if sampler_backend is None else sampler_backend)
        else "hardware"
    )


def _is_simulator(thing: Any) -> bool:
    """Whether a class of `thing` is defined in a module that only simulates."""
    homes = (f"{base.__module__}." for base in type(thing).__mro__)
    return any(home.startswith(_SIMULATORS) for home in homes)


def _simulator(backend: Any, device: Device, couplings: Couplings = frozenset()) -> Any:
    """Aer with the noise of the backend's calibration; of couplings only that of these.

    `AerSimulator.from_backend` reads the target, which has one readout error for both states; the
    properties, if the backend has them, have both.
    """
    try:
        import qiskit_ibm_runtime  # noqa: F401
        from qiskit_aer import AerSimulator
        from qiskit_aer.noise import NoiseModel
        from qiskit_aer.noise.device import basic_device_gate_errors, basic_device_readout_errors
    except ImportError as missing:
        raise MissingExtraError("Running circuits through a Qiskit sampler", "qiskit") from missing
    properties = properties_of(backend)
    source = {"target": backend.target}
    if properties is not None:
        properties = copy(properties)
        properties.gates = [
            gate
            for gate in properties.gates
            if len(gate.qubits) == 1 or (gate.gate, *gate.qubits) in couplings
        ]
        source = {"properties": properties}
    noise = NoiseModel(basis_gates=[*device.basis_gates, "id", *{gate for gate, *_ in couplings}])
    for qubits, error in basic_device_readout_errors(**source):
        noise.add_readout_error(error, qubits)
    for gate, qubits, error in basic_device_gate_errors(**source):
        is_known = len(qubits) == 1 and (gate == "id" or gate in device.qubits[qubits[0]].gates)
        if is_known or (gate, *qubits) in couplings:
            noise.add_quantum_error(error, gate, qubits)
    # Shots in one thread: counts do not depend on the number of cores.
    return AerSimulator(noise_model=noise, max_parallel_shots=1, max_parallel_experiments=0)
