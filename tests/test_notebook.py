"""The notebook runs from its first cell to its last, and no cell floods the page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from qcompile.notebook import reward_text

NOTEBOOK = Path(__file__).parents[1] / "examples/first_hour.ipynb"


@pytest.fixture(scope="module")
def stored() -> Any:
    return nbformat.read(NOTEBOOK, as_version=4)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[list[Any]]]:
    """The outputs of each code cell, and the folder they were made in."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(folder)}}).execute()
    return folder, [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]


def test_it_is_stored_without_outputs(stored: Any) -> None:
    for cell in stored.cells:
        if cell.cell_type == "code":
            assert (cell.outputs, cell.execution_count) == ([], None)


def test_its_code_is_short(stored: Any) -> None:
    lines = [c.source.splitlines() for c in stored.cells if c.cell_type == "code"]
    assert sum(map(len, lines)) <= 25


def test_cells_show_tables_and_pictures(outputs: tuple[Path, list[list[Any]]]) -> None:
    folder, cells = outputs
    shown = [output.data for cell in cells for output in cell if "data" in output]
    assert sum("image/png" in data for data in shown) == 4
    assert sum("text/html" in data for data in shown) == 8
    assert {path.name for path in folder.iterdir()} == {"devices.png", "devices.json", "mine.pt"}


def test_no_cell_floods_the_page(outputs: tuple[Path, list[list[Any]]]) -> None:
    for cell in outputs[1]:
        text = "\n".join(
            output.text if output.output_type == "stream" else output.data.get("text/plain", "")
            for output in cell
        )
        assert len(text.splitlines()) <= 40
        assert not re.search("warn|░", text, re.IGNORECASE)  # nor leaves a progress bar


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.955, 0.0123), "0.95 ± 0.01"),
        ((-9.996,), "-10.00"),
        ((-10.04, 3.25), "-10.0 ± 3.2"),
        ((500.0, 0.0), "500.0 ± 0.0"),
        ((0.5, None, "+"), "+0.50"),
    ],
)
def test_small_rewards_have_two_decimals(arguments: tuple[Any, ...], words: str) -> None:
    assert reward_text(*arguments) == words
