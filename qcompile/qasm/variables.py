"""The constants, variables and inputs of a program file.

qcompile runs a file from top to bottom, so every variable has a known value at every line.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from qcompile.errors import CircuitError
from qcompile.ir import Angle
from qcompile.qasm.expressions import CONSTANTS, Scope, source_of
from qcompile.qasm.operators import AmbiguousError, NoOperationError, binary
from qcompile.qasm.values import FLOAT, Type, Value


class Variables:
    """The named values of a file, and the `scope` that evaluates expressions with them."""

    def __init__(self, *, real: bool, products: bool = False):
        self.scope = Scope(dict(CONSTANTS), {}, real, products)
        self.inputs: list[str] = []
        self._types: dict[str, Type] = {}
        self._depth = 0

    def input(self, name: str) -> None:
        """Declare `name` as an input, whose value is known when the program is bound."""
        self.scope.constants[name] = Value(FLOAT, Angle.symbol(name))
        self.inputs.append(name)

    def constant(self, name: str, type: Type, expression: Any) -> None:
        """Declare a constant; outside blocks gate bodies see it too.

        Raises:
            CircuitError: the expression is not a constant, or does not fit the type.
        """
        value = self._converted(expression, type)
        if isinstance(value.number, Angle) and not value.number.is_constant:
            raise CircuitError(f"{source_of(expression)!r} is not a constant.")
        if self._depth:
            self.scope.variables[name] = value
        else:
            self.scope.constants[name] = value

    def declare(self, name: str, type: Type, expression: Any | None) -> None:
        """Declare a variable of this type, with a value if there is an expression."""
        self._types[name] = type
        value = None if expression is None else self._converted(expression, type)
        self.scope.variables[name] = value

    def set(self, name: str, type: Type, value: Value) -> None:
        """Declare or replace a variable with this type and value."""
        self._types[name], self.scope.variables[name] = type, value

    @contextmanager
    def block(self) -> Iterator[None]:
        """Names declared within the block are removed after it."""
        variables = self.scope.variables
        before = len(variables)
        self._depth += 1
        yield
        self._depth -= 1
        while len(variables) > before:
            name, _ = variables.popitem()
            self._types.pop(name, None)

    @contextmanager
    def subroutine(self) -> Iterator[None]:
        """Within the block, the file's variables are hidden; its constants are visible."""
        variables, types = dict(self.scope.variables), dict(self._types)
        self.scope.variables.clear()
        self._types.clear()
        yield
        self.scope.variables.clear()
        self._types.clear()
        self.scope.variables.update(variables)
        self._types.update(types)

    def assign(self, name: str, operator: str, expression: Any) -> None:
        """Perform `name operator expression`, such as `a = 0.4` or `a *= 2`.

        Raises:
            CircuitError: there is no such variable, it has no value yet, or the value does not fit.
        """
        if name not in self._types:
            raise CircuitError(f"{name!r} is not a variable.", "Declare one: float a = 0.5;")
        type = self._types[name]
        if operator == "=":
            self.scope.variables[name] = self._converted(expression, type)
            return
        before = self.scope.named(name)
        operand = self.scope.value(expression, to_whole=type.is_whole)
        try:
            value = binary(operator[:-1], before, operand, to_whole=type.is_whole)
        except (NoOperationError, AmbiguousError, ArithmeticError) as error:
            raise CircuitError(
                f"'{name} {operator} {source_of(expression)}' has no value here."
            ) from error
        self.scope.variables[name] = value.to(type)

    def _converted(self, expression: Any, type: Type) -> Value:
        value = self.scope.value(expression, to_whole=type.is_whole)
        try:
            return value.to(type)
        except CircuitError as error:
            raise CircuitError(f"{source_of(expression)!r}: {error}") from error
