"""Splits the PUBs of a call into jobs, and joins their bits into a sampler's result."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from qcompile.errors import OptionError
from qcompile.execution import check_shots, portions
from qcompile.execution.cost import Portion
from qcompile.live.records import Register
from qcompile.live.request import Request
from qcompile.terminal import first_line

DEFAULT_SHOTS = 4096
"""The shots if neither the PUB nor the call sets them; IBM's own default."""


class Call:
    """The PUBs of one call, and the `requests` for their jobs, in order.

    A job has PUBs with the same shots, as IBM's sampler requires, and no more executions than IBM
    accepts. So PUBs with different shots become separate jobs, and large jobs are split by PUBs and
    then by rows of their values.

    Raises:
        CountsError: the shots of a PUB are out of range.
        OptionError: an item is not a PUB, or measures nothing.
    """

    def __init__(self, pubs: Iterable[Any], shots: int | None = None):
        self.pubs = [_pub(index, pub, shots) for index, pub in enumerate(_several(pubs))]
        if not self.pubs:
            raise OptionError("There is no PUB to run.", "Pass at least one: run([circuit]).")
        self._places: list[list[Portion]] = []
        self.requests: list[Request] = []
        for of_shots in dict.fromkeys(pub.shots for pub in self.pubs):
            chosen = [index for index, pub in enumerate(self.pubs) if pub.shots == of_shots]
            for job in portions([self.pubs[index].size for index in chosen], of_shots):
                places = [Portion(chosen[place.pub], place.rows) for place in job]
                pieces = tuple(_piece(self.pubs[place.pub], place.rows) for place in places)
                self._places.append(places)
                self.requests.append(Request(pieces, of_shots))

    def result(self, parts: Sequence[Sequence[Register]]) -> Any:
        """The PrimitiveResult, from the registers that each request measured."""
        from qiskit.primitives import BitArray, DataBin, PrimitiveResult, SamplerPubResult

        arrays = [
            {
                register.name: np.zeros((pub.size, pub.shots, -(-register.size // 8)), np.uint8)
                for register in pub.circuit.cregs
            }
            for pub in self.pubs
        ]
        for places, registers in zip(self._places, parts, strict=True):
            for register in registers:
                place = places[register.pub]
                rows = slice(place.rows.start, place.rows.stop)
                array = arrays[place.pub][register.name]
                array[rows] = register.bits.reshape(len(place.rows), *array.shape[1:])
        results = []
        for pub, of_pub in zip(self.pubs, arrays, strict=True):
            bits = {
                register.name: BitArray(
                    of_pub[register.name].reshape(*pub.shape, *of_pub[register.name].shape[1:]),
                    register.size,
                )
                for register in pub.circuit.cregs
            }
            metadata = {"circuit_metadata": pub.circuit.metadata}
            results.append(SamplerPubResult(DataBin(**bits, shape=pub.shape), metadata))
        return PrimitiveResult(results, {"version": 2})


def _several(pubs: Any) -> list[Any]:
    """The PUBs as a list.

    Raises:
        OptionError: they are not in a list.
    """
    from qiskit import QuantumCircuit

    if isinstance(pubs, QuantumCircuit) or not isinstance(pubs, Iterable):
        raise OptionError(
            "PUBs must be in a list.", "Call run([circuit]) or run([(circuit, values)])."
        )
    return list(pubs)


def _pub(index: int, pub: Any, shots: int | None) -> Any:
    """A SamplerPub with its own shots, and with a parameter if it has more than one row."""
    from qiskit.exceptions import QiskitError
    from qiskit.primitives.containers.sampler_pub import SamplerPub

    try:
        coerced = SamplerPub.coerce(pub, DEFAULT_SHOTS if shots is None else shots)
        coerced.validate()
        values = coerced.parameter_values.as_array(coerced.circuit.parameters)
        if not np.isfinite(values).all():
            raise ValueError("one of its values is not finite.")
    except (LookupError, TypeError, ValueError, QiskitError) as error:
        raise OptionError(
            f"PUB {index} is not valid: {first_line(str(error))}",
            "A PUB is a circuit, or (circuit, values), or (circuit, values, shots).",
        ) from error
    check_shots(coerced.shots)
    if not coerced.circuit.cregs:
        raise OptionError(
            f"PUB {index} measures nothing: its circuit has no classical register.",
            "Add one with circuit.measure_all().",
        )
    return coerced if coerced.circuit.num_parameters or not coerced.shape else _with_phase(coerced)


def _with_phase(pub: Any) -> Any:
    """The same PUB with its global phase as a parameter: samplers take rows from parameters."""
    from qiskit.circuit import Parameter
    from qiskit.primitives.containers.sampler_pub import SamplerPub

    circuit = pub.circuit.copy()
    circuit.global_phase = phase = Parameter("phase")
    return SamplerPub.coerce((circuit, {phase: np.zeros(pub.shape)}, pub.shots))


def _piece(pub: Any, rows: range) -> Any:
    """The given rows of a PUB; with all rows it keeps its shape."""
    from qiskit.primitives.containers.sampler_pub import SamplerPub

    if len(rows) == pub.size:
        return pub
    values = pub.parameter_values.ravel()[rows.start : rows.stop]
    return SamplerPub(pub.circuit, values, pub.shots)
