"""Error messages: hints for outdated syntax, and a bound on their length."""

from __future__ import annotations

import pytest

from qcompile.errors import ProgramFileError
from qcompile.qasm import read
from qcompile.qasm.messages import LONGEST_MESSAGE


def refusal(text: str, name: str = "p") -> str:
    with pytest.raises(ProgramFileError) as caught:
        read(text, name)
    return str(caught.value)


@pytest.mark.parametrize(
    ("statement", "hint"),
    [
        ("qubit q[2];", "Write: qubit[2] q;"),
        ("bit  c [n+1] ;", "Write: bit[n+1] c;"),
        ("qubit $0;", "Remove the line: $0 is always available."),
        ("qubit[1] $12;", "Remove the line: $12 is always available."),
        ("int n[32] = 4;", "Write: int[32] n = 4;"),
        ("const n = 3;", "Write: const float n = 3;"),
    ],
)
def test_outdated_syntax_gets_a_hint(statement, hint):
    assert refusal(f"OPENQASM 3.0;\n{statement}\n") == (
        f"p:2: {statement!r} is not OpenQASM.\n  {hint}"
    )


def test_the_hints_are_valid_openqasm():
    assert read("OPENQASM 3.0;\nqubit[2] q;\nx q;\n").program.circuits[0].gates


@pytest.mark.parametrize(
    "text",
    [
        "qubit q;\nrx(" + "x" * 5000 + ") q;\n",
        "qubit " + "q" * 5000 + ";\nx q;\n",
        'include "' + "a" * 5000 + '";\n',
        "qubit q;\n" + "".join(f"float v{i:060} = 1;\n" for i in range(40)) + "rx(w) q;\n",
        "qubit q;\ncx(" + "1+" * 1000 + "1) q, q;\n",
        "€" * 5000,
        "qubit q;\nx q" + "[0]" * 300 + ";\n",
    ],
)
@pytest.mark.parametrize("name", ["p", "d/" * 300 + "p"])
def test_messages_are_short_and_name_the_file_and_line(text, name):
    message = refusal(text, name)
    assert len(message) <= LONGEST_MESSAGE
    place = message.split(": ")[0]
    assert place.rpartition(":")[0].endswith("p")
    assert 1 <= int(place.rpartition(":")[2]) <= text.count("\n") + 1


def test_control_characters_are_not_shown():
    message = refusal('qubit q;\ninclude "\x1b[31mred\u202e";\n')
    assert "\x1b" not in message
    assert "\u202e" not in message


def test_the_first_fault_of_a_file_is_reported():
    assert refusal("qubit q;\nnope q;\nx q q;\n").startswith("p:2: Unknown gate 'nope'.")
