"""What commands answer: tests/golden/output, and the shape of their JSON: tests/golden/json."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from golden_cases import documents, outputs
from golden_cases.case import transcript
from golden_files import WIDTH, check, check_names


@pytest.fixture(autouse=True)
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder with the files of the cases, and a terminal of a known width."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


@pytest.mark.parametrize("name", outputs.SESSIONS)
def test_output(name: str, qcompile: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    outputs.files()
    outputs.MORE_FILES.get(name, lambda: None)()
    check(f"output/{name}", transcript(outputs.SESSIONS[name], qcompile, monkeypatch))


def test_every_output_has_its_session() -> None:
    check_names("output", outputs.SESSIONS)


@pytest.mark.parametrize("name", documents.SESSIONS)
def test_json(name: str, qcompile: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    outputs.files()
    outputs.MORE_FILES.get(name, lambda: None)()
    check(f"json/{name}", transcript(documents.SESSIONS[name], qcompile, monkeypatch))


def test_every_document_has_its_session() -> None:
    check_names("json", (*documents.SESSIONS, "live"))
