"""The protocol of passes, and passes over runs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal, Protocol

from qcompile.ir import Program
from qcompile.ir.runs import split

Promise = Literal["unitary", "distribution"]


class Pass(Protocol):
    """A step of compilation.

    `keeps` is what the pass promises to preserve for every circuit and every value of the symbols:
    the "unitary" up to global phase, or the "distribution" of the Z measurement from |0>. A pass
    never changes its input. A property test runs every pass of `qcompile.passes.PASSES` on random
    programs and checks exactly its promise.
    """

    name: ClassVar[str]
    keeps: ClassVar[Promise]

    def apply(self, program: Program) -> Program: ...


class RunPass(ABC):
    """A pass that rewrites the runs of wide circuits as it rewrites circuits of one qubit."""

    def apply(self, program: Program) -> Program:
        if not program.is_wide:
            return self.rewrite(program)
        runs, skeleton = split(program)
        return skeleton.join(self.rewrite(runs))

    @abstractmethod
    def rewrite(self, program: Program) -> Program:
        """The program of circuits of one qubit, rewritten."""
