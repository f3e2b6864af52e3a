"""Notebooks run from their first cell to their last, and no cell floods the page."""

from __future__ import annotations

import ast
import re
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from qcompile.notebook import reward_text

CHECKOUT = Path(__file__).parents[1]
PAGE = (CHECKOUT / "docs" / "howto" / "notebook.md").read_text()
NOTEBOOKS = sorted((CHECKOUT / "examples").glob("*.ipynb"))
SCREEN = 40
"""Lines of a screen."""


@dataclass(frozen=True)
class Executed:
    """The outputs of each code cell, and the files that were written."""

    name: str
    cells: list[list[Any]]
    files: set[str]

    def shown(self, kind: str) -> int:
        """How many outputs are of this kind."""
        return sum(kind in output.get("data", {}) for cell in self.cells for output in cell)


@pytest.fixture(scope="module", params=NOTEBOOKS, ids=lambda path: path.stem)
def executed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Executed:
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(request.param, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    cells = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    return Executed(request.param.stem, cells, {path.name for path in folder.iterdir()})


def code(path: Path) -> list[Any]:
    notebook = nbformat.read(path, as_version=4)
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_there_are_five() -> None:
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_stored_without_outputs(path: Path) -> None:
    assert {(*cell.outputs, cell.execution_count) for cell in code(path)} == {(None,)}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_cell_of_code_fits_a_screen(path: Path) -> None:
    assert max(len(cell.source.splitlines()) for cell in code(path)) <= SCREEN


def test_the_first_hour_is_short() -> None:
    assert sum(len(cell.source.splitlines()) for cell in code(NOTEBOOKS[0])) <= 25


def imported(path: Path) -> set[str]:
    """The packages that the cells of a notebook import."""
    nodes = [*ast.walk(ast.parse("\n".join(cell.source for cell in code(path))))]
    plain = [name.name for node in nodes if isinstance(node, ast.Import) for name in node.names]
    named = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in [*plain, *named]}


def test_what_the_page_installs_is_enough_for_all() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    installed = re.search(r"^pip install .*'\.\[([\w,]+)\]' jupyterlab$", PAGE, re.MULTILINE)
    assert installed is not None
    needed = {name for path in NOTEBOOKS for name in imported(path)}
    assert "qiskit" in needed
    assert needed & {*project["optional-dependencies"]} <= {*installed[1].split(",")}


def test_the_first_two_blocks_of_the_page_are_cells_that_show_something(tmp_path: Path) -> None:
    cells = re.findall(r"^```py(?:thon)?\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)[:2]
    notebook = nbformat.v4.new_notebook(cells=[*map(nbformat.v4.new_code_cell, cells)])
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [{kind for output in cell.outputs for kind in output.data} for cell in notebook.cells]
    assert "text/html" in shown[0]
    assert "image/png" in shown[1]


def test_git_ignores_what_notebooks_write() -> None:
    if not (CHECKOUT / ".git").exists():
        pytest.skip("not a checkout of git")
    written = [f"examples/{name}" for name in ("mine.pt", "devices.png", "pole.pt")]
    kept = ["examples/01_first_hour.ipynb", "examples/study.toml"]
    words = ["git", "check-ignore", "--no-index", *written, *kept]
    found = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert found.stdout.split() == written


def test_cells_show_tables_and_pictures(executed: Executed) -> None:
    assert executed.shown("image/png") >= 2
    assert executed.shown("text/html") >= 2
    if executed.name.startswith("01"):
        assert executed.shown("image/png") == 4
        assert executed.shown("text/html") == 8
        assert executed.files == {"devices.png", "devices.json", "mine.pt"}


def test_no_cell_floods_the_page(executed: Executed) -> None:
    for cell in executed.cells:
        text = "\n".join(
            output.text if output.output_type == "stream" else output.data.get("text/plain", "")
            for output in cell
        )
        assert len(text.splitlines()) <= SCREEN
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
