"""The two programs: the work of a job, and its results in each program's format."""

from __future__ import annotations

import base64
import io
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from ibm_quantum_schemas.common import CompressedTensorModel
from ibm_quantum_schemas.executor.version_2_0 import (
    CircuitItemModel,
    ItemMetadataModel,
    MetadataModel,
    ParamsModel,
    QuantumProgramResultItemModel,
    QuantumProgramResultModel,
)
from pydantic import ValidationError
from qiskit import qpy
from qiskit.primitives.containers import BitArray, DataBin, PrimitiveResult, SamplerPubResult
from qiskit_ibm_runtime import RuntimeEncoder

from .backends import Machine
from .physics import BoolArray, Item, Plan, RefusedError, plan

DEFAULT_SHOTS = 4096
"""Of a PUB that names none, in a job whose options name none."""

Bits = Sequence[Mapping[str, BoolArray]]


@dataclass(frozen=True)
class Work:
    """The work of a job, and the conversion of its bits to the body of its results."""

    items: tuple[Item, ...]
    encode: Callable[[Bits], str]

    @property
    def circuits(self) -> int:
        return sum(item.circuits for item in self.items)

    @property
    def executions(self) -> int:
        return sum(item.executions for item in self.items)

    @property
    def shots(self) -> int:
        """Of one circuit; the most, where items differ."""
        return max((item.shots for item in self.items), default=0)


def read_work(program_id: str, params: Mapping[str, Any], machine: Machine) -> Work:
    """The work of a job's `params`.

    Raises:
        RefusedError: the service does not take such a job; the message says why.
    """
    readers = {"sampler": _read_sampler, "executor": _read_executor}
    if program_id not in readers:
        raise RefusedError(f"There is no program {program_id!r}; there are sampler and executor.")
    try:
        return readers[program_id](params, machine)
    except RefusedError:
        raise
    except (ValidationError, KeyError, TypeError, ValueError, zlib.error) as error:
        raise RefusedError(f"The params of the job cannot be read: {error}") from error


def _read_sampler(params: Mapping[str, Any], machine: Machine) -> Work:
    options = params.get("options") or {}
    twirling = options.get("twirling") or {}
    if twirling.get("enable_gates") or twirling.get("enable_measure"):
        raise RefusedError("The stand-in does not twirl.")
    _refuse_others(options.get("dynamical_decoupling"), options.get("execution"))
    items = []
    for circuit, values, shots in params["pubs"]:
        [played] = _plans(circuit["__value__"], machine)
        array = np.load(io.BytesIO(_unpacked(values["__value__"])), allow_pickle=False)
        shots = int(shots or options.get("default_shots") or DEFAULT_SHOTS)
        items.append(_item(played, array, shots))
    return Work(tuple(items), _sampler_body)


def _refuse_others(
    decoupling: Mapping[str, Any] | None, execution: Mapping[str, Any] | None
) -> None:
    if (decoupling or {}).get("enable"):
        raise RefusedError("The stand-in does not decouple.")
    if (execution or {}).get("meas_type", "classified") != "classified":
        raise RefusedError("The stand-in measures classified bits.")


def _read_executor(params: Mapping[str, Any], machine: Machine) -> Work:
    program = ParamsModel.model_validate(params).quantum_program
    if program.meas_level != "classified":
        raise RefusedError("The stand-in measures classified bits.")
    packed = params["quantum_program"]["circuits"].get("b64_data")
    if packed is None:
        raise RefusedError("The stand-in reads circuits in QPY.")
    items = []
    for played, item in zip(_plans(packed, machine), program.items, strict=True):
        if not isinstance(item, CircuitItemModel):
            raise RefusedError("The stand-in does not twirl.")
        items.append(_item(played, item.circuit_arguments.to_numpy(), program.shots))
    encode = _executor_body(program.passthrough_data, program.semantic_role)
    return Work(tuple(items), encode)


def _item(played: Plan, values: Any, shots: int) -> Item:
    array = np.asarray(values, dtype=np.float64)
    if array.shape[-1:] != (played.parameters,):
        raise RefusedError(
            f"Parameter values of shape {array.shape} for {played.parameters} parameters."
        )
    return Item(played, array, shots)


def _plans(packed: str, machine: Machine) -> tuple[Plan, ...]:
    return _unpack_plans(packed, machine.basis_gates, machine.qubits)


@lru_cache(maxsize=512)
def _unpack_plans(packed: str, basis_gates: tuple[str, ...], width: int) -> tuple[Plan, ...]:
    """The plans of circuits in QPY; a training run sends the same few circuits step after step."""
    circuits = qpy.load(io.BytesIO(_unpacked(packed)))
    return tuple(plan(circuit, basis_gates, width) for circuit in circuits)


def _unpacked(text: str) -> bytes:
    return zlib.decompress(base64.b64decode(text))


def _sampler_body(bits: Bits) -> str:
    results = []
    for registers in bits:
        arrays = {
            name: BitArray.from_bool_array(array, order="little")
            for name, array in registers.items()
        }
        shape = next((array.shape[:-2] for array in registers.values()), ())
        metadata: dict[str, Any] = {"circuit_metadata": {}}
        results.append(SamplerPubResult(DataBin(**arrays, shape=shape), metadata))
    return json.dumps(PrimitiveResult(results, {"version": 2}), cls=RuntimeEncoder)


def _executor_body(passthrough: Any, role: str | None) -> Callable[[Bits], str]:
    def encode(bits: Bits) -> str:
        data = [
            QuantumProgramResultItemModel(
                results={n: CompressedTensorModel.from_numpy(a) for n, a in registers.items()},
                metadata=ItemMetadataModel(),
            )
            for registers in bits
        ]
        result = QuantumProgramResultModel(
            data=data,
            metadata=MetadataModel(chunk_timing=[]),
            passthrough_data=passthrough,
            semantic_role=role,
        )
        return str(result.model_dump_json())

    return encode
