"""Tables as Markdown, CSV and LaTeX, read back."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from qcompile.errors import FigureError
from qcompile.report.table import Cell, Column, Table, latex_text

TABLE = Table(
    [
        Column("policy", right=False),
        Column("mean ± std", parts=("mean", "standard deviation")),
        Column("time", "s"),
    ],
    [
        ["a_b|c & <d>", Cell("12.3 ± 4.5", (12.3456, 4.5678)), Cell("1.2e-05", (1.2e-05,))],
        ["100 % \\x{y}~^#$", Cell("-", (None, None)), Cell("-3", (-3,))],
    ],
    "a 100 %\ntitle",
)


def test_markdown_has_a_row_for_each_row() -> None:
    assert TABLE.markdown() == (
        "| policy | mean ± std | time, s |\n"
        "| --- | ---: | ---: |\n"
        "| a\\_b\\|c & \\<d\\> | 12.3 ± 4.5 | 1.2e-05 |\n"
        "| 100 % \\\\x{y}~^#$ | - | -3 |\n"
        "\na 100 % title\n"
    )


def test_csv_has_the_numbers_apart_and_not_rounded() -> None:
    header, first, second = csv.reader(TABLE.csv().splitlines())
    assert header == ["policy", "mean", "standard deviation", "time, s"]
    assert first == ["a_b|c & <d>", "12.3456", "4.5678", "1.2e-05"]
    assert second == ["100 % \\x{y}~^#$", "", "", "-3"]


def test_latex_is_a_tabular_with_the_rules_of_booktabs() -> None:
    assert TABLE.latex() == (
        "% needs \\usepackage{booktabs}\n"
        "% a 100 % title\n"
        "\\begin{tabular}{lrr}\n"
        "\\toprule\n"
        "policy & mean $\\pm$ std & time, s \\\\\n"
        "\\midrule\n"
        "a\\_b\\textbar{}c \\& \\textless{}d\\textgreater{} & 12.3 $\\pm$ 4.5 & "
        "$1.2 \\times 10^{-5}$ \\\\\n"
        "100 \\% \\textbackslash{}x\\{y\\}\\textasciitilde{}\\textasciicircum{}\\#\\$ & - & "
        "$-3$ \\\\\n"
        "\\bottomrule\n"
        "\\end{tabular}\n"
    )


def grid(
    *rows: tuple[str, str, str, str], interval: str = "1.0 to 2.0", by: str = "ideal"
) -> Table:
    """Policy, backend, shots and mitigation of each row; those on ideal leave no choice."""
    columns = [
        Column("policy", right=False, setting=True),
        Column("backend", right=False, setting=True),
        Column("shots", setting=True),
        Column("mitigation", setting=True),
        Column("mean ± std"),
        Column("95 % interval"),
        Column("solved"),
    ]
    cells = [
        [
            policy,
            backend,
            *(Cell(word, (word,), by * (backend == "ideal")) for word in (shots, mitigation)),
            Cell("1.5 ± 0.3", (1.5, 0.3)),
            interval,
            "-",
        ]
        for policy, backend, shots, mitigation in rows
    ]
    return Table(columns, cells, "two episodes")


IDEAL, LIMA, BELEM = (
    ("mine", "ideal", "exact", "none"),
    ("mine", "lima", "32", "readout"),
    ("mine", "belem", "32", "readout"),
)


def test_a_paper_has_settings_that_are_all_the_same_in_the_title() -> None:
    """What ideal leaves no choice of keeps no column; nor do dashes, nor a second spread."""
    table = grid(IDEAL, LIMA, BELEM).for_paper()
    assert table.header == ["backend", "mean", "95 % interval"]
    assert table.words[1] == ["lima", "1.5", "1.0 to 2.0"]
    assert table.title == (
        "two episodes, policy mine, shots 32 (ideal: exact), mitigation readout (ideal: none)"
    )


def test_a_paper_keeps_settings_that_differ_or_stand_alone() -> None:
    other = grid(IDEAL, LIMA, ("mine", "lima", "64", "readout")).for_paper()
    assert other.header == ["backend", "shots", "mean", "95 % interval"]
    alone = grid(LIMA).for_paper()
    assert alone.header == ["policy", "backend", "shots", "mitigation", "mean", "95 % interval"]


def test_a_paper_keeps_the_deviation_where_an_interval_is_missing() -> None:
    table = grid(LIMA, BELEM, interval="-").for_paper()
    assert table.header == ["backend", "mean ± std"]
    assert table.words[0] == ["lima", "1.5 ± 0.3"]


def test_csv_keeps_every_column() -> None:
    header, *_ = csv.reader(grid(IDEAL, LIMA, BELEM).csv().splitlines())
    assert header[:4] == ["policy", "backend", "shots", "mitigation"]
    assert "solved" in header


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("+0.25", "$+0.25$"),
        ("-1,234.5 to -3", "$-1{,}234.5$ to $-3$"),
        ("ibm_lima-2", "ibm\\_lima-2"),
        ("2026-11-27", "2026-11-27"),
        ("a\nb", "a b"),
        ("−5", "$-$5"),
        ("\\input{x}", "\\textbackslash{}input\\{x\\}"),
    ],
)
def test_text_for_latex(text: str, expected: str) -> None:
    assert latex_text(text) == expected


@pytest.mark.parametrize("name", ["a.txt", "a.html", "a", "a.TEX"])
def test_other_suffixes_are_refused_in_words(tmp_path: Path, name: str) -> None:
    with pytest.raises(FigureError, match=r"must end with \.md, \.csv or \.tex\.$"):
        TABLE.save(tmp_path / name)


@pytest.mark.parametrize("name", ["a.md", "a.csv", "a.tex"])
def test_the_suffix_says_what_is_saved(tmp_path: Path, name: str) -> None:
    TABLE.save(tmp_path / name)
    forms = {"a.md": TABLE.markdown(), "a.csv": TABLE.csv(), "a.tex": TABLE.latex()}
    assert (tmp_path / name).read_text() == forms[name]


def test_a_notebook_shows_a_table_and_a_terminal_its_columns() -> None:
    assert "<td>a_b|c &amp; &lt;d&gt;</td>" in TABLE._repr_html_()
    assert str(TABLE).splitlines()[0].split() == ["policy", "mean", "±", "std", "time,", "s"]


def test_notes_stand_beside_the_rows_but_not_in_csv() -> None:
    table = Table([Column("a")], [["1"]], notes=["2 of 3 *finished*.\nNo more."])
    assert table.markdown().endswith("| 1 |\n\n2 of 3 \\*finished\\*. No more.\n")
    assert table.latex().startswith(
        "% needs \\usepackage{booktabs}\n% 2 of 3 *finished*. No more.\n\\begin{tabular}"
    )
    assert str(table).endswith("No more.")
    assert "<p>2 of 3 *finished*." in table._repr_html_()
    assert table.csv() == "a\n1\n"


@pytest.mark.parametrize("first", ["[5cm] x", "*star", " [x]"])
def test_the_beginning_of_a_row_is_no_argument_of_what_precedes_it(first: str) -> None:
    r"""\\ and \midrule take a bracket behind them for their own, and \\ a star."""
    lines = Table([Column(first)], [[first], [first]]).latex().splitlines()
    assert [line for line in lines if line.endswith("\\\\")] == [f"{{}}{first} \\\\"] * 3


def test_letters_of_latex_that_every_encoding_has() -> None:
    assert latex_text('"αλπ"') == "''$\\alpha$$\\lambda$$\\pi$''"


def test_a_number_and_a_null() -> None:
    cells = [Cell.of(1.23456, ".2f"), Cell.of(None), Cell.of("exact")]
    table = Table([Column(name) for name in "abc"], [cells])
    assert table.words == [["1.23", "-", "exact"]]
    assert table.csv() == "a,b,c\n1.23456,,exact\n"
