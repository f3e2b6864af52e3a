"""Counts of journals of earlier formats, as the bits that a sampler may have given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from qcompile.arrays import CountArray
from qcompile.live.records import Register
from qcompile.live.request import Request


def bits_of_ones(ones: CountArray, request: Request) -> list[Register]:
    """Bits of which `ones` (rows, circuits) are 1, those first.

    Earlier formats kept nothing else of a job, whose circuits were those of packed rounds.

    Raises:
        ValueError: the ones are not those of such a request.
    """
    columns = [pub.circuit.metadata.get("circuits", []) for pub in request.pubs]
    order = np.sort(np.concatenate(columns))
    rows = {pub.size for pub in request.pubs}
    if ones.dtype.kind != "i" or rows != {len(ones)} or ones.shape[1:] != order.shape:
        raise ValueError("ones of another shape")
    if ones.min() < 0 or ones.max() > request.shots:
        raise ValueError("ones that the shots do not have")
    shots = np.arange(request.shots)[:, None]
    filled = []
    for register, circuits in zip(request.registers, columns, strict=True):
        of_pub = ones[:, np.searchsorted(order, circuits)]
        bits = np.zeros((len(ones), request.shots, 8 * register.bytes_a_shot), dtype=bool)
        bits[..., : -register.width - 1 : -1] = shots < of_pub[:, None, :]  # bit 0 comes last
        filled.append(replace(register, packed=np.packbits(bits, axis=-1).tobytes()))
    return filled
