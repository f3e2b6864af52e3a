"""The protocol of passes: frozen dataclasses that take a program and return a new one."""

from __future__ import annotations

from typing import ClassVar, Literal, Protocol

from qcompile.ir import Program

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
