"""What a pass is: a frozen dataclass that takes a program and returns a new one."""

from __future__ import annotations

from typing import ClassVar, Literal, Protocol

from qcompile.ir import Program

Promise = Literal["unitary", "distribution"]


class Pass(Protocol):
    """A step of compilation.

    `keeps` is its promise for every circuit and every value of the symbols: "unitary" up to global
    phase, or the "distribution" of the Z measurement from |0>. A pass never touches its input; one
    property test runs every pass of `qcompile.passes.PASSES` on random programs and checks exactly
    its promise.
    """

    name: ClassVar[str]
    keeps: ClassVar[Promise]

    def apply(self, program: Program) -> Program: ...
