"""Counts from journals of earlier formats, as bits that a sampler could have returned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from qcompile.arrays import CountArray
from qcompile.live.records import Register
from qcompile.live.request import Request


def bits_of_ones(ones: CountArray, request: Request) -> list[Register]:
    """Bits with `ones` (rows, circuits) ones per circuit, the ones first.

    Earlier formats kept only these counts; the circuits of a job were those of packed rounds, each
    of one qubit.

    Raises:
        ValueError: the counts do not fit the request.
    """
    columns = [pub.circuit.metadata.get("circuits", []) for pub in request.pubs]
    order = np.sort(np.concatenate(columns))
    rows = {pub.size for pub in request.pubs}
    if ones.dtype.kind != "i" or rows != {len(ones)} or ones.shape[1:] != order.shape:
        raise ValueError("counts of the wrong shape")
    if [register.width for register in request.registers] != [*map(len, columns)]:
        raise ValueError("counts of circuits of several qubits")
    if ones.min() < 0 or ones.max() > request.shots:
        raise ValueError("counts outside the number of shots")
    shots = np.arange(request.shots)[:, None]
    filled = []
    for register, circuits in zip(request.registers, columns, strict=True):
        of_pub = ones[:, np.searchsorted(order, circuits)]
        bits = np.zeros((len(ones), request.shots, 8 * register.bytes_a_shot), dtype=bool)
        bits[..., : -register.width - 1 : -1] = shots < of_pub[:, None, :]  # bit 0 comes last
        filled.append(replace(register, packed=np.packbits(bits, axis=-1).tobytes()))
    return filled
