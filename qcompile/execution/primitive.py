"""The executor that runs circuits through a Qiskit sampler, by default Aer with a backend's noise.

Source: qiskit.primitives, SamplerV2 and BitArray; qiskit_aer.noise.device for the noise.
"""

from __future__ import annotations

import warnings
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.device import Device, Kind
from qcompile.errors import DeviceError, MissingExtraError, QcompileError
from qcompile.execution.executor import Executor, check_device
from qcompile.execution.packed import REGISTER, PackedExecutable, PackedRound, count_ones
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
"""Up to this many circuits side by side, a density matrix is faster than a state per shot."""


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
        self._sampler = sampler
        self._simulator: Any = _simulator(backend, self.device) if sampler is None else None

    def prepare(self, executable: Executable) -> Prepared:
        """The executable with its rounds as circuits.

        Raises:
            DeviceError: the executable was compiled for another device.
        """
        check_device(executable, self.device)
        return _PreparedSampler(executable, self)

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
                sampler = self._simulation(max(len(packed.circuits) for packed in rounds))
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

    def _simulation(self, width: int) -> Any:
        """A sampler with a new seed, for jobs of up to `width` circuits side by side."""
        from qiskit_ibm_runtime import SamplerV2

        dense = width <= _WIDEST_DENSITY_MATRIX
        method = "density_matrix" if dense else "matrix_product_state"
        self._simulator.set_options(method=method)
        seed = int(self.rng.integers(1, 2**31))  # the runtime treats 0 as no seed
        with warnings.catch_warnings():
            # Its successor in 0.51 gives every pub the same seed, so rounds would be dependent.
            warnings.simplefilter("ignore", DeprecationWarning)
            return SamplerV2(mode=self._simulator, options={"simulator": {"seed_simulator": seed}})


class _PreparedSampler(PackedExecutable):
    def __init__(self, executable: Executable, executor: PrimitiveExecutor):
        super().__init__(executable)
        self._executor = executor
        self.shots_only = (
            f"{executor.device.name} runs through a sampler, which needs shots.",
            "Give a number of shots, for example 8192.",
            "For expectations without shot noise use a device of `qcompile backends`.",
        )

    def ones(
        self, x: FloatArray, theta: FloatArray, shots: CircuitShots, rng: Binomial | None = None
    ) -> CountArray:
        most = largest_shots(shots)
        angles = self.executable.bind(x, theta)
        circuits = np.arange(len(self.executable.native))
        if not len(angles) or not len(circuits):
            return np.zeros((len(angles), len(circuits)), dtype=np.int64)
        bits = self._executor.bits(self.rounds, angles, most)
        return count_ones(self.rounds, bits, circuits, shots)


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


def _simulator(backend: Any, device: Device) -> Any:
    """Aer with the noise of the backend's calibration.

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
        properties.gates = [gate for gate in properties.gates if len(gate.qubits) == 1]
        source = {"properties": properties}
    noise = NoiseModel(basis_gates=[*device.basis_gates, "id"])
    for qubits, error in basic_device_readout_errors(**source):
        noise.add_readout_error(error, qubits)
    for gate, qubits, error in basic_device_gate_errors(**source):
        if gate == "id" or gate in device.qubits[qubits[0]].gates:
            noise.add_quantum_error(error, gate, qubits)
    # Shots in one thread: counts do not depend on the number of cores.
    return AerSimulator(noise_model=noise, max_parallel_shots=1, max_parallel_experiments=0)
