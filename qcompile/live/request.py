"""What one job measures."""

from __future__ import annotations

from typing import Any, Protocol

from qcompile.arrays import CountArray


class Request(Protocol):
    """Circuits with their angles and shots, for one job."""

    @property
    def digest(self) -> str:
        """The same for the same circuits, qubits, angles and shots, and for nothing else."""
        ...

    @property
    def executions(self) -> int: ...

    @property
    def shots(self) -> int: ...

    def pubs(self) -> list[Any]:
        """Circuits and their values, as SamplerV2 takes them."""
        ...

    def ones(self, result: Any) -> CountArray:
        """The ones of each circuit, (rows, circuits), of a sampler's result.

        Raises:
            ValueError: the result is not that of these pubs.
        """
        ...
