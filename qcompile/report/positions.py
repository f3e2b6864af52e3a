"""Where a map draws the qubits of a device."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import Device

_APART = 1e-3
"""Qubits start apart, even those in the same place of a symmetric device."""


def positions_of(device: Device) -> FloatArray:
    """The place of each qubit, (qubits, 2): to the right and downwards, a coupling about 1 long.

    They are the device's own, or those where distances are as the couplings count them.
    """
    places = np.array(device.positions, dtype=float)
    if not device.positions:
        pairs = {tuple(sorted(coupling.qubits)) for coupling in device.couplings}
        places = _laid_out(len(device.qubits), tuple(sorted(pairs)))
    return np.asarray(places - places.min(axis=0))


@lru_cache(maxsize=8)
def _laid_out(qubits: int, pairs: tuple[tuple[int, ...], ...]) -> FloatArray:
    """The layout of Kamada and Kawai, from the first eigenvectors of the couplings' Laplacian.

    Kamada and Kawai, Information Processing Letters 31 (1989) 7. Parts that are not connected are
    joined for it. It lies broad side down, the lowest qubits above and on the left.
    """
    import networkx

    graph = networkx.empty_graph(qubits)
    graph.add_edges_from(pairs)
    joined = networkx.Graph(graph)
    joined.add_edges_from(networkx.k_edge_augmentation(graph, 1, partial=True))
    start = networkx.spectral_layout(joined)
    apart = {qubit: start[qubit] + _APART * np.array([qubit % 2, qubit % 3]) for qubit in start}
    found = networkx.kamada_kawai_layout(joined, pos=apart)
    places = np.array([found[qubit] for qubit in range(qubits)])
    places -= places.mean(axis=0)
    _, _, axes = np.linalg.svd(places, full_matrices=False)
    places = places @ axes.T
    order = np.arange(qubits) - (qubits - 1) / 2
    places *= np.where(order @ places < 0, -1.0, 1.0)
    ends = np.array(pairs, dtype=int).reshape(-1, 2)
    lengths = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
    return np.asarray(places / (lengths.mean() if len(lengths) else 1.0))
