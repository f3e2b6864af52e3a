"""Every message that is cheaply provoked, area by area: tests/golden/messages."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from golden_cases.case import transcript
from golden_files import WIDTH, check, check_names

AREAS = (
    "programs",
    "values",
    "policies",
    "networks",
    "packing",
    "devices",
    "calibrations",
    "running",
    "environments",
    "evaluating",
    "calibrating",
    "circuits",
    "training",
    "studying",
    "journals",
    "python",
)


@pytest.mark.parametrize("area", AREAS)
def test_messages(
    area: str,
    qcompile: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    module = import_module(f"golden_cases.{area}")
    module.files()
    check(f"messages/{area}", transcript(module.CASES, qcompile, monkeypatch))


def test_every_file_has_its_area() -> None:
    check_names("messages", (*AREAS, "live"))
