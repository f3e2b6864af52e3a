"""One statement of a program file, parsed by the grammar of the file's version."""

from __future__ import annotations

import contextlib
import io
import re
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.qasm.grammar import OpaqueGate, UnreadSubroutine, parse_2, parse_3
from qcompile.qasm.messages import HINTS
from qcompile.qasm.statements import BLANK, Span
from qcompile.qasm.terms import WORDS_2, WORDS_3, ParseError, unexpected
from qcompile.terminal import one_line

LONGEST_STATEMENT = 5_000_000
_LONGEST_FOR_ANTLR = 100_000
"""The most characters of one statement; the full parser uses about a kilobyte for each."""

_LONGEST_QUOTE = 63

_ONLY_3 = WORDS_3 - WORDS_2 - {"gphase"}
_HEADER = re.compile(r"OPENQASM\s+([0-9]+)(?:\.[0-9]+)?\s*;")
_SUBROUTINE = re.compile(r"def\s+([^\W\d]\w*)")
_LOCATED = re.compile(r"L(\d+):C\d+: (.*)", re.DOTALL)


class Grammar:
    """Reads the statements of `text`; `version` is "2" or "3", or None if the text has none.

    An OpenQASM 2 file may use statements of OpenQASM 3, and a file without a version those of
    OpenQASM 2.

    Raises:
        CircuitError: the version is unknown.
    """

    def __init__(self, text: str):
        self._text = text
        self._own: set[str] = set()
        """The gates that an OpenQASM 2 file has defined so far."""
        start = BLANK.match(text).end()  # type: ignore[union-attr]
        header = _HEADER.match(text, start)
        self.start = header.end() if header else start
        self.version = header[1] if header else None
        if self.version not in ("2", "3", None):
            number = header[0].split()[1].rstrip(";")  # type: ignore[index]
            raise CircuitError(f"Unknown OpenQASM version {number}.", "Use 2.0 or 3.0.")

    def parse(self, span: Span, line: int) -> Any:
        """The node of a statement that starts in `line`; the spans of nodes are lines of the file.

        Raises:
            ParseError: the text is not a statement; `line` of the error says where.
            RecursionError: the statement is nested too deeply.
        """
        if span.word == "/*":
            raise ParseError(line, "A comment does not end.", "Is its */ missing?")
        _require_short(span.end - span.start, LONGEST_STATEMENT, line)
        text = self._text[span.start : span.end]
        if span.word == "OPENQASM":
            raise ParseError(line, "OPENQASM must be the first statement, and appear only once.")
        try:
            return self._parse(text, span.word, line)
        except ParseError as fault:
            for pattern, hint in HINTS:
                if match := pattern.match(text):
                    raise ParseError(
                        line, f"{match[0]!r} is not OpenQASM.", match.expand(hint)
                    ) from fault
            raise

    def _parse(self, text: str, word: str, line: int) -> Any:
        if self.version != "2":
            with contextlib.suppress(ParseError):
                return parse_3(text, line)
            try:
                return _parse_fully(text, line)
            except ParseError:
                if self.version is None:
                    with contextlib.suppress(ParseError):
                        return parse_2(text, line)
                raise
        try:
            if word in _ONLY_3 and word not in self._own:
                raise ParseError(line, f"Unknown gate {word!r}.")
            node = parse_2(text, line)
        except ParseError:
            with contextlib.suppress(ParseError):
                # ^ is an exclusive or in OpenQASM 3, and a power, **, in OpenQASM 2.
                return _parse_fully(text.replace("^", "**"), line)
            raise
        if isinstance(node, ast.QuantumGateDefinition | OpaqueGate):
            self._own.add(node.name.name)
        return node


def _parse_fully(text: str, line: int) -> Any:
    """The node of any statement of OpenQASM 3."""
    from openqasm3.parser import QASM3ParsingError, parse

    _require_short(len(text), _LONGEST_FOR_ANTLR, line)
    try:
        # ANTLR prints errors to standard error besides raising them.
        with contextlib.redirect_stderr(io.StringIO()):
            statements = parse(text).statements
    except QASM3ParsingError as error:
        raise _fault(error, line) from error
    except RecursionError:
        raise
    except Exception as error:
        # Converting an odd literal may raise any exception, which the parser does not catch.
        if subroutine := _SUBROUTINE.match(text):
            node = UnreadSubroutine(ast.Identifier(subroutine[1]))
            node.span = ast.Span(line, 0, line, 0)
            return node
        raise ParseError(
            line, f"The statement {one_line(text, _LONGEST_QUOTE)!r} cannot be read."
        ) from error
    if len(statements) != 1:
        raise ParseError(line, f"The statement {one_line(text, _LONGEST_QUOTE)!r} cannot be read.")
    _move(statements[0], line - 1)
    return statements[0]


def _require_short(length: int, most: int, line: int) -> None:
    if length > most:
        raise ParseError(
            line,
            f"A statement of {length} characters is too long.",
            f"The limit is {most}. Is a ';' or a bracket missing?",
        )


def _fault(error: Exception, line: int) -> ParseError:
    if match := _LOCATED.match(str(error)):
        return ParseError(line + int(match[1]) - 1, f"Syntax error: {match[2]}.")
    cause = error.__cause__
    token = getattr(cause.args[0], "offendingToken", None) if cause and cause.args else None
    if token is None:
        return ParseError(line, "Syntax error.", "The text is not an OpenQASM 2 or 3 program.")
    return unexpected(line + token.line - 1, "" if token.text == "<EOF>" else token.text)


def _move(node: Any, lines: int) -> None:
    """Add `lines` to the lines of a statement and of those in its body."""
    node.span.start_line += lines
    for value in vars(node).values():
        for inner in value if isinstance(value, list) else ():
            if isinstance(inner, ast.Statement):
                _move(inner, lines)
