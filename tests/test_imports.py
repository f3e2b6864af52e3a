"""Import directions, lazy loading, and the public names."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import qcompile

PACKAGE = Path(qcompile.__file__).parent

ORDER = (
    {"arrays", "caller", "characters", "errors", "limits", "version"},
    {"catalogue", "foreign", "notebook", "output", "streams", "terminal", "validation"},
    {"reading", "clashes"},
    {"ir"},
    {"simulate", "qasm", "native"},
    {"device"},
    {"noise", "calibration"},
    {"passes", "snapshot"},
    {"states"},
    {"nn"},
    {"execution"},
    {"interop"},
    {"qiskit"},
    {"mitigation"},
    {"policy"},
    {"deploy"},
    {"jobs", "rl", "live"},
    {"planning"},
    {"report"},
    {"sweep"},
    {"page"},
    {"verbs"},
    {"cli"},
    {"__main__"},
)
"""docs/background/architecture.md: a room imports from itself and from the lines above its own."""

LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}

DOORS = {
    "ir/program.py": {
        "qcompile.interop.qiskit.program_of",
        "qcompile.interop.pennylane.program_of",
        "qcompile.interop.openqasm.program_of",
        "qcompile.report.drawing.Form",
        "qcompile.report.drawing.draw_program",
    },
    "passes/executable.py": {
        "qcompile.interop.qiskit.circuits_of",
        "qcompile.report.drawing.Form",
        "qcompile.report.drawing.draw_executable",
        "qcompile.report.device_map.draw_executable_map",
        "qcompile.report.figure.Figure",
        "qcompile.report.style.AnyStyle",
    },
    "calibration/calibration.py": {
        "qcompile.report.calibration.draw_calibration",
        "qcompile.report.calibration_values.calibration_html",
        "qcompile.report.calibration_values.calibration_values",
        "qcompile.report.figure.Figure",
        "qcompile.page.calibration.calibration_document",
        "qcompile.page.render.write_report",
        "qcompile.report.style.AnyStyle",
    },
}
"""The only imports that point upwards: Program.from_*, Executable.to_qiskit, `draw` of both and
Calibration.plot load, when they are called, the function of a higher room that does their work."""

VERBS = ["run", "evaluate", "train", "calibrate", "validate", "plan", "study"]
NAMES = [name for name in qcompile.__all__ if name not in (*VERBS, "Live")]

HEAVY = (
    *("torch", "cvxpy", "gymnasium", "matplotlib", "qiskit", "openqasm3", "imageio_ffmpeg", "PIL"),
    *(
        "networkx",
        "pennylane",
        "jinja2",
        "qiskit_ibm_runtime",
        "ibm_cloud_sdk_core",
        "tenacity",
        "requests",
    ),
)


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of everything that a file imports from qcompile, within functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno} imports relatively"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            parts = name.split(".")
            if parts[0] == "qcompile" and parts[1:2] != ["__version__"]:
                yield node.lineno, name


MODULES = sorted(PACKAGE.rglob("*.py"))


def test_every_room_has_its_place() -> None:
    assert {room(path) for path in MODULES} - {"__init__"} == set(LEVEL)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    own = room(path)
    if own == "__init__":
        return  # the front door: its names are loaded when they are used
    doors = DOORS.get(str(path.relative_to(PACKAGE)), set())
    wrong = [
        f"{path.name}:{line} imports {name}"
        for line, name in imports(path)
        if (other := name.split(".")[1]) != own and LEVEL[other] >= LEVEL[own] and name not in doors
    ]
    assert not wrong


def test_every_door_is_there_and_opens_within_a_function() -> None:
    for file, doors in DOORS.items():
        assert doors <= {name for _, name in imports(PACKAGE / file)}
        outside = ast.parse((PACKAGE / file).read_text()).body
        assert not any(
            (node.module or "").startswith(("qcompile.interop", "qcompile.report", "qcompile.page"))
            for node in outside
            if isinstance(node, ast.ImportFrom)
        )


def loaded_by(statement: str) -> set[str]:
    """The heavy packages that a fresh interpreter holds after `statement`."""
    code = f"{statement}\nimport sys\nprint('loaded', *sys.modules)"
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True
    )
    modules = found.stdout.rpartition("loaded ")[2].split()
    return {name.partition(".")[0] for name in modules} & set(HEAVY)


@pytest.mark.parametrize(
    "statement",
    [
        "import qcompile",
        "import qcompile.ir, qcompile.passes, qcompile.simulate, qcompile.noise, "
        "qcompile.execution, qcompile.policy, qcompile.device, "
        "qcompile.snapshot, qcompile.mitigation, qcompile.qasm, "
        "qcompile.jobs.program_file, qcompile.jobs.policy_job, qcompile.interop.qiskit, "
        "qcompile.interop.pennylane, qcompile.interop.openqasm",
        "import qcompile.live.budget, qcompile.live.connection, qcompile.live.request, "
        "qcompile.live.jobs, qcompile.live.journal, qcompile.live.measure, qcompile.live.task",
        f"import qcompile\nfor name in {NAMES}: getattr(qcompile, name)",
        "import sys\nfrom qcompile.cli import main\nsys.argv = ['qcompile', '--help']\n"
        "try: main()\nexcept SystemExit as ended: assert ended.code == 0",
    ],
    ids=["qcompile", "rooms", "live", "names", "--help"],
)
def test_heavy_packages_are_loaded_where_used(statement: str) -> None:
    assert loaded_by(statement) == set()


def test_verbs_load_no_more_than_the_environments() -> None:
    assert loaded_by(f"import qcompile\nfor name in {VERBS}: getattr(qcompile, name)") <= {
        "gymnasium"
    }


def test_playing_live_loads_no_more_than_the_environments() -> None:
    rooms = "qcompile.live.perform, qcompile.live.validate, qcompile.planning.strategies"
    assert loaded_by(f"import {rooms}") <= {"gymnasium"}


@pytest.mark.parametrize("command", ["run", "plan", "calibrate", "validate", "runs", "resume"])
def test_help_of_a_command_loads_nothing_heavy(command: str) -> None:
    assert loaded_by(f"import qcompile.cli.{command}") == set()


def test_measuring_loaded_modules_works() -> None:
    assert loaded_by("import openqasm3") == {"openqasm3"}


def test_public_names_are_there_the_verbs_first() -> None:
    others = qcompile.__all__[len(VERBS) :]
    assert qcompile.__all__ == [*VERBS, *sorted(others)]
    for name in qcompile.__all__:
        assert getattr(qcompile, name).__module__.startswith("qcompile.")
    assert {*qcompile.__all__, "__version__"} == set(dir(qcompile))


def test_a_name_that_is_not_there_is_named() -> None:
    with pytest.raises(AttributeError, match="module 'qcompile' has no attribute 'nosuch'"):
        qcompile.nosuch  # noqa: B018


BENCHMARKS = sorted((PACKAGE.parent / "benchmarks").glob("*.py"))


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.name)
def test_benchmarks_import_existing_names(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("qcompile"):
            home = import_module(node.module or "")
            for name in (alias.name for alias in node.names):
                assert hasattr(home, name) or import_module(f"{node.module}.{name}")
