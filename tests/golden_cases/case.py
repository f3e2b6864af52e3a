"""A case is something said to qcompile; its transcript is that and the answer."""

from __future__ import annotations

import io
import json
import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import pytest
from golden_files import stable, without_figures

from qcompile.errors import ProgramFileError, QcompileError
from qcompile.qasm import read

Call = Callable[..., Any]
"""Calls the command line with these words: `.code`, `.out` and `.err`."""
Change = Callable[[pytest.MonkeyPatch], object]

_VARIABLE = re.compile(r"[A-Z_]+=")
_SHOWN_LINES, _SHOWN_LETTERS = 12, 100
_KINDS = {
    bool: "boolean",
    dict: "object",
    float: "number",
    int: "integer",
    list: "list",
    str: "string",
    type(None): "null",
}


class Case(Protocol):
    def transcript(self, call: Call, patch: pytest.MonkeyPatch) -> str: ...


@dataclass(frozen=True)
class Command:
    """A line as it is typed in a shell, without `qcompile`; variables may stand before it.

    `change` is made before and undone afterwards; `note` says what it is, `typed` what is typed
    where a question is asked. What was drawn at random is `masked`: words remain, figures do not.
    """

    line: str
    note: str = ""
    change: Change = lambda patch: None
    typed: str = ""
    masked: bool = False

    def transcript(self, call: Call, patch: pytest.MonkeyPatch) -> str:
        words = shlex.split(self.line)
        count = next(i for i, word in enumerate([*words, ""]) if not _VARIABLE.match(word))
        variables, words = words[:count], words[count:]
        with patch.context() as own:
            for name, _, value in (variable.partition("=") for variable in variables):
                own.setenv(name, value)
            own.setattr("sys.stdin", io.StringIO(self.typed))
            self.change(own)
            answer = call(*words)
        shown = " ".join([*variables, "qcompile", *map(_quoted, words)])
        both = "[standard error]\n" if answer.out and answer.err else ""
        said = stable(f"{_ended(self.shown(answer.out))}{both}{_ended(answer.err)}", Path.cwd())
        said = without_figures(said) if self.masked else said
        note = f"# {self.note}\n" if self.note else ""
        return f"{note}$ {shown}\n{said}" + (f"exit {answer.code}\n" if answer.code else "")

    def shown(self, out: str) -> str:
        """What is shown of standard output."""
        return out


@dataclass(frozen=True)
class Document(Command):
    """A command with --json: what is shown is the shape of its document."""

    def shown(self, out: str) -> str:
        return "".join(f"{line}\n" for line in shape(json.loads(out)))


@dataclass(frozen=True)
class Written:
    """A file that a command wrote: its first `lines`, or all of them."""

    path: str
    lines: int | None = None
    masked: bool = False

    def transcript(self, call: Call, patch: pytest.MonkeyPatch) -> str:
        text = Path(self.path).read_text(encoding="utf-8").splitlines(keepends=True)
        said = stable("".join(text[: self.lines]), Path.cwd())
        tool = "cat" if self.lines is None else f"head -n {self.lines}"
        return f"$ {tool} {self.path}\n{_ended(without_figures(said) if self.masked else said)}"


@dataclass(frozen=True)
class Program:
    """An OpenQASM text; its transcript is the refusal, or the circuits."""

    text: str
    note: str = ""
    change: Change = lambda patch: None

    def transcript(self, call: Call, patch: pytest.MonkeyPatch) -> str:
        with patch.context() as own:
            self.change(own)
            try:
                answer = str(read(self.text, "p.qasm").program)
            except ProgramFileError as error:
                answer = str(error)
        lines = [_cut(line) for line in self.text.removesuffix("\n").split("\n")]
        if len(lines) > _SHOWN_LINES:
            lines[_SHOWN_LINES - 1 :] = ["..."]
        shown = "".join(f"| {line}".rstrip() + "\n" for line in lines)
        return (f"# {self.note}\n" if self.note else "") + f"{shown}{answer}\n"


@dataclass(frozen=True)
class Expression:
    """A line of Python, evaluated among `names`; its transcript is the error, or the value."""

    code: str
    names: Callable[[], dict[str, Any]]

    def transcript(self, call: Call, patch: pytest.MonkeyPatch) -> str:
        try:
            answer = repr(eval(self.code, self.names()))
        except QcompileError as error:
            answer = f"{type(error).__name__}: {error}"
        return stable(f">>> {self.code}\n{answer}\n", Path.cwd())


def shape(value: Any) -> list[str]:
    """The types of a JSON value, an indented line for each key; entries of a list are one."""
    name, inside = _described([value])
    return [name, *inside]


def _described(values: list[Any]) -> tuple[str, list[str]]:
    """The types that these values have, and the lines of what is in them."""
    kinds = sorted({_KINDS[type(value)] for value in values})
    lines: list[str] = []
    objects = [value for value in values if isinstance(value, dict)]
    for key in sorted({key for value in objects for key in value}):
        name, inside = _described([value[key] for value in objects if key in value])
        lines += [f"  {key}: {name}", *(f"  {line}" for line in inside)]
    entries = [entry for value in values if isinstance(value, list) for entry in value]
    name, inside = _described(entries) if entries else ("nothing", [])
    types = (f"list of {name}" if kind == "list" else kind for kind in kinds)
    return " or ".join(types), lines + inside


def transcript(cases: Sequence[str | Case], call: Call, patch: pytest.MonkeyPatch) -> str:
    """All cases, one after the other; a text is a `Command`."""
    known = [Command(case) if isinstance(case, str) else case for case in cases]
    return "\n".join(case.transcript(call, patch) for case in known)


def _quoted(word: str) -> str:
    return _cut(word) if re.fullmatch(r"[\w@%+=:,./<>-]+", word) else shlex.quote(_cut(word))


def _cut(text: str) -> str:
    text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    if len(text) <= _SHOWN_LETTERS:
        return text
    return f"{text[:40]}... ({len(text)} letters)"


def _ended(text: str) -> str:
    return text if text.endswith("\n") or not text else f"{text}\n"
