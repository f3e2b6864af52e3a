"""Files of studies and evaluations: CSV, Markdown tables, links from a page to its folder."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path

from qcompile.output import write_file


def csv_text(header: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """A CSV document; None is an empty field."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(lines)
    return text.getvalue()


def markdown_table(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A Markdown table with a row for each of `lines`."""
    rows = (header, ("---",) * len(header), *lines)
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def markdown_text(text: str) -> str:
    """Text from a file, escaped for Markdown: it cannot end a table cell or start HTML."""
    return text.replace("|", "\\|").replace("<", "&lt;")


def assignments(values: Mapping[str, object]) -> str:
    """Names with their values in JSON."""
    return markdown_text(", ".join(f"{name} = {json.dumps(v)}" for name, v in values.items()))


def version_words(versions: Mapping[str, str]) -> str:
    """Packages and their versions in one line."""
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def link(folder: Path, page: Path) -> str:
    """The path of the folder relative to the page, for a link."""
    return Path(os.path.relpath(folder.resolve(), page.resolve().parent)).as_posix()


def write_files(files: Mapping[Path, bytes]) -> list[Path]:
    """Write every file; their paths.

    Raises:
        OutputError: one of them cannot be written.
    """
    for path, contents in files.items():
        write_file(path, contents)
    return [*files]
