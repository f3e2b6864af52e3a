"""Loops, branches and subroutines, unrolled: every value in a file is known when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.qasm.expressions import source_of
from qcompile.qasm.gates import require_count
from qcompile.qasm.registers import Reference, Registers
from qcompile.qasm.values import BOOL, INT, Value
from qcompile.qasm.variables import Variables


class Blocks:
    """Runs the statements of bodies with `run`, calling `step` before each.

    The declarations of a body end with it; `declared` holds the names in use.
    """

    def __init__(
        self,
        variables: Variables,
        registers: Registers,
        declared: dict[str, None],
        run: Callable[[Any], None],
        step: Callable[[], None],
    ):
        self._variables, self._registers, self._declared = variables, registers, declared
        self._run, self._step = run, step
        self._subroutines: dict[str, Any] = {}
        self._active: list[str] = []

    def body(self, statements: list[Any]) -> None:
        """Run `statements` in a new scope."""
        before = len(self._declared)
        with self._variables.block():
            for statement in statements:
                self._step()
                self._run(statement)
        while len(self._declared) > before:
            name, _ = self._declared.popitem()
            self._registers.drop(name)

    def loop(self, statement: Any) -> None:
        """Run a `for` over whole numbers, or over a set of values."""
        scope, name = self._variables.scope, statement.identifier.name
        type = scope.type_of(statement.type)
        if type is None or name in self._declared:
            raise CircuitError(f"{source_of(statement)}: {name!r} cannot be the loop variable.")
        for value in self._values(statement.set_declaration):
            self._step()
            with self._variables.block():
                self._variables.set(name, type, value.to(type))
                self.body(statement.block)

    def _values(self, node: Any) -> Iterator[Value]:
        scope = self._variables.scope
        if isinstance(node, ast.DiscreteSet):
            return iter([scope.value(value) for value in node.values])
        if not isinstance(node, ast.RangeDefinition) or node.start is None or node.end is None:
            raise CircuitError(
                f"A loop over {source_of(node)!r} is not supported.",
                "Loops run over [first:last], [first:step:last] or {a, b, c}.",
            )
        step = 1 if node.step is None else scope.whole_number(node.step)
        if step == 0:
            raise CircuitError(f"The step of {source_of(node)!r} is 0.")
        first, last = scope.whole_number(node.start), scope.whole_number(node.end)
        return (Value(INT, i) for i in range(first, last + (1 if step > 0 else -1), step))

    def branch(self, statement: Any) -> bool:
        """Run one side of an `if`; False if its condition is unknown, such as one on bits."""
        try:
            condition = self._variables.scope.value(statement.condition).to(BOOL)
        except CircuitError:
            return False
        self.body(statement.if_block if condition.number else statement.else_block)
        return True

    def define(self, name: str, statement: Any) -> None:
        """Define a subroutine; None stands for one that cannot be read, so must not be called."""
        self._subroutines[name] = statement

    def knows(self, name: str) -> bool:
        return name in self._subroutines

    def call(self, expression: Any) -> None:
        """Run a subroutine on qubits and numbers."""
        name, definition = expression.name.name, self._subroutines[expression.name.name]
        if definition is None or definition.return_type is not None:
            raise CircuitError(
                f"Subroutine {name!r} cannot be called here.",
                "qcompile supports subroutines of gates on qubits and numbers, without a result.",
            )
        if name in self._active:
            raise CircuitError(f"Subroutine {name!r} calls itself.")
        require_count(name, len(definition.arguments), len(expression.arguments), "argument")
        qubits: dict[str, Reference] = {}
        numbers = []
        for argument, given in zip(definition.arguments, expression.arguments, strict=True):
            if isinstance(argument, ast.QuantumArgument):
                qubits[argument.name.name] = self._qubits(argument, given)
            else:
                numbers.append(self._number(argument, given))
        self._active.append(name)
        with self._variables.subroutine(), self._registers.renamed(qubits), self._own_names():
            for number in numbers:
                self._variables.set(*number)
            self.body(definition.body)
        self._active.pop()

    def _qubits(self, argument: Any, given: Any) -> Reference:
        scope = self._variables.scope
        reference = self._registers.resolve(given, scope, "qubit")
        size = None if argument.size is None else scope.whole_number(argument.size)
        if reference.single != (size is None) or len(reference.positions) != (size or 1):
            raise CircuitError(
                f"{source_of(given)!r} does not fit the argument {source_of(argument)!r}."
            )
        return reference

    def _number(self, argument: Any, given: Any) -> tuple[str, Any, Value]:
        scope = self._variables.scope
        type = scope.type_of(argument.type)
        if type is None:
            raise CircuitError(f"An argument {source_of(argument)!r} is not supported.")
        return argument.name.name, type, scope.value(given).to(type)

    @contextmanager
    def _own_names(self) -> Iterator[None]:
        """Within the block, names of the subroutine may hide names of the file."""
        before = dict(self._declared)
        self._declared.clear()
        yield
        self._declared.update(before)
