"""What live runs say, with a stand-in of IBM's service, and the shape of their JSON."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from golden_cases import live
from golden_cases.case import transcript
from golden_files import WIDTH, check
from standin import StandIn


def test_live_messages(
    qcompile: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    monkeypatch.setenv("USAGE_DATA_OPT_OUT", "True")
    monkeypatch.setattr("click.formatting.FORCED_WIDTH", WIDTH)
    monkeypatch.setattr(live.ACCOUNTS, str(tmp_path / "accounts.json"))
    for name, seconds in live.PAUSES_S.items():
        monkeypatch.setattr(name, seconds)
    live.files()
    with StandIn() as service:
        for name, value in service.environment().items():
            monkeypatch.setenv(name, value)
        said = transcript((*live.USAGE, *live.cases(service)), qcompile, monkeypatch)
        service.recover()
        documents = transcript(live.DOCUMENTS, qcompile, monkeypatch)
    check("messages/live", said)
    check("json/live", documents)
