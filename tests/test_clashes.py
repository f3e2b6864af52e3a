"""Files that would overwrite one another, by whatever name."""

from __future__ import annotations

from pathlib import Path

import pytest

from qcompile import clashes
from qcompile.caller import command_line, option
from qcompile.clashes import beside, check_clashes
from qcompile.errors import OptionError


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_file_that_is_read_is_not_written() -> None:
    with pytest.raises(OptionError, match=r"^cal and table are the same file, x/\.\./a\.csv\.\n"):
        check_clashes({"cal": Path("a.csv")}, {"table": Path("x/../a.csv")})
    check_clashes({"cal": Path("a.csv"), "check": Path("a.csv")}, {"table": Path("b.csv")})


def test_links_are_followed() -> None:
    Path("a.csv").write_text("")
    Path("link.csv").symlink_to("a.csv")
    with pytest.raises(OptionError, match="out and table are the same file"):
        check_clashes({}, {"out": Path("a.csv"), "table": Path("link.csv")})


def test_case_counts_where_the_file_system_sees_it(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {"out": Path("new/A.csv"), "table": Path("new/a.CSV")}
    monkeypatch.setattr(clashes, "ignores_case", lambda folder: False)
    check_clashes({}, names)
    monkeypatch.setattr(clashes, "ignores_case", lambda folder: True)
    with pytest.raises(OptionError, match="out and table are the same file"):
        check_clashes({}, names)


def test_the_file_system_is_asked_for_its_case(tmp_path: Path) -> None:
    Path("probe").touch()
    assert clashes.ignores_case(tmp_path / "not" / "there") == Path("PROBE").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["probe"], "nothing is left behind"


def test_a_file_has_no_other_inside_but_a_folder_has() -> None:
    inner = {"log": Path("b/c.csv"), "out": Path("b")}
    with pytest.raises(OptionError, match=r"^log: b/c\.csv is inside out, a file\.$"):
        check_clashes({}, inner)
    check_clashes({}, inner, folders=["out"])
    with pytest.raises(OptionError, match="out and table are the same file"):
        check_clashes({}, {**inner, "table": Path("b")}, folders=["out"])


def test_pairs_are_allowed_for_themselves_alone() -> None:
    state = Path("state")
    allowed = [frozenset({"resume", "checkpoint"})]
    check_clashes({"resume": state}, {"checkpoint": state}, allowed=allowed)
    with pytest.raises(OptionError, match="resume and log"):
        check_clashes({"resume": state}, {"checkpoint": state, "log": state}, allowed=allowed)


def test_files_of_the_caller_count_within_its_block() -> None:
    with beside(reads={"style": Path("s")}), beside(writes={"table": Path("t"), "plot": None}):
        with pytest.raises(OptionError, match="style and out"):
            check_clashes({}, {"out": Path("s")})
        with pytest.raises(OptionError, match="out and table"):
            check_clashes({}, {"out": Path("t")})
        check_clashes({}, {"table": Path("t")})
    check_clashes({}, {"out": Path("t")})


def test_options_are_named_as_the_caller_writes_them() -> None:
    names = ("max_steps", "imports", "settings")
    assert [*map(option, names)] == ["max_steps", "imports", "settings"]
    with command_line():
        assert [*map(option, names)] == ["--max-steps", "--import", "--set"]
    assert option("within") == "within"
