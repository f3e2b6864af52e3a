"""The wheel holds what it needs: installed by itself, far from the checkout, it plays."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest

pytest.importorskip("build")
pytest.importorskip("hatchling")

CHECKOUT = Path(__file__).parents[1]
POLICIES = sorted(path.stem for path in (CHECKOUT / "trained").glob("*.pt"))
DEVICES = sorted(path.stem for path in (CHECKOUT / "hardware").glob("*.json"))

Run = Callable[..., str]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("dist")
    words = ["-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(CHECKOUT)]
    subprocess.run([sys.executable, *words], check=True, capture_output=True)
    return next(out.glob("qcompile-*.whl"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Call a script of a fresh environment, in an empty folder outside the checkout.

    The environment has the wheel, and finds its dependencies where this one has them: through a
    .pth file, which does not follow the .pth file of an editable install in turn.
    """
    home = tmp_path_factory.mktemp("home")
    environment = home / "venv"
    venv.create(environment, with_pip=False, symlinks=os.name != "nt")
    paths = {"base": str(environment), "platbase": str(environment)}
    scripts = Path(sysconfig.get_path("scripts", "venv", paths))
    packages = Path(sysconfig.get_path("purelib", "venv", paths))
    python = scripts / Path(sys.executable).name
    words = ["--python", str(python), "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True)
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    empty = home / "empty"
    empty.mkdir()

    def run(script: str, *words: str) -> str:
        variables = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        found = subprocess.run(
            [scripts / script, *words],
            cwd=empty,
            env=variables,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert found.returncode == 0, found.stderr
        return found.stdout

    where = Path(run(python.name, "-c", "import qcompile; print(qcompile.__file__)").strip())
    assert where.is_relative_to(packages)
    return run


def test_the_wheel_holds_the_data_and_nothing_of_the_workshop(wheel: Path) -> None:
    names = ZipFile(wheel).namelist()
    assert {f"qcompile/hardware/{name}.json" for name in DEVICES} <= set(names)
    assert {f"qcompile/trained/{name}.pt" for name in POLICIES} <= set(names)
    package = CHECKOUT / "qcompile"
    kinds = ("*.toml", "*.mplstyle", "templates/*")
    data = {path.relative_to(CHECKOUT).as_posix() for k in kinds for path in package.rglob(k)}
    assert "qcompile/rl/presets/paper.toml" in data
    assert "qcompile/page/templates/page.html" in data
    assert data <= set(names)
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"qcompile"}
    assert not [name for name in names if "__pycache__" in name or "/." in name]


def test_shipped_devices_are_found(installed: Run) -> None:
    devices = json.loads(installed("qcompile", "backends", "--json"))
    assert [device["name"] for device in devices] == ["ideal", *DEVICES]
    shown = json.loads(installed("qcompile", "backends", "show", "ibm_lima", "--json"))
    assert len(shown["qubits"]) == 5


def test_shipped_policies_are_found(installed: Run) -> None:
    assert POLICIES, "the checkout ships no policy"
    code = "import json, qcompile, sys\nfor name in sys.argv[1:]: qcompile.load_policy(name)"
    installed("python", "-c", code, *POLICIES)


def test_a_shipped_policy_plays(installed: Run) -> None:
    words = ("run", "cartpole", "--backend", "ibm_lima", "--episodes", "1", "--json")
    found = json.loads(installed("qcompile", *words))
    assert found["kind"] == "noise-model"
    assert len(found["episodes"]) == 1
