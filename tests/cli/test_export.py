"""`qcompile export`: the job, whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]


def test_a_parametric_job(qcompile: Call, policy: Call, left: Call) -> None:
    answer = qcompile("export", policy(), "--backend", "ibm_lima", "--out", "job")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out == (
        "1 program(s) of 4 circuits for ibm_lima at level 2, and job.json, in job\n"
    )
    assert left() == ["job", "job/job.json", "job/round0.qasm", "tiny.json"]
    job = json.loads(Path("job/job.json").read_text())
    assert set(job) == {"format", "backend", "level", "shots", "programs"}
    assert set(job["programs"][0]) == {"file", "circuits", "qubits", "inputs", "observation"}
    assert job["programs"][0]["observation"] is None


def test_the_json_document_is_the_job(qcompile: Call, policy: Call) -> None:
    answer = qcompile("export", policy(), "--out", "job", "--shots", 100, "--json")
    assert (answer.code, answer.err) == (0, "")
    assert answer.json() == json.loads(Path("job/job.json").read_text())
    assert answer.json()["shots"] == 100


def test_observations_are_bound(qcompile: Call, policy: Call, left: Call) -> None:
    Path("rows.csv").write_text("0,0,0,0\n1,2,3,4\n")
    words = ("--observations", "rows.csv", "--format", "qasm2", "--out", "new/job")
    answer = qcompile("export", policy(), *words)
    assert answer.code == 0
    assert [name for name in left() if name.endswith("qasm")] == [
        "new/job/observation0-round0.qasm",
        "new/job/observation1-round0.qasm",
    ]


def folder_in_use() -> None:
    Path("job").mkdir()
    Path("job/mine").touch()


REFUSED: dict[str, tuple[tuple[str, ...], str]] = {
    "folder in use": (
        (),
        "Error: job already exists.\n  Remove it, or choose another with --out.\n",
    ),
    "under a file": (
        ("--out", "tiny.json/job"),
        "Error: Cannot write tiny.json/job.\n  tiny.json is not a folder.\n"
        "  Choose another path.\n",
    ),
    "OpenQASM 2 without observations": (
        ("--out", "new", "--format", "qasm2"),
        "Error: OpenQASM 2 has no inputs, so it cannot hold a parametric job.\n"
        "  Give --observations FILE to bind the angles, or use --format qasm3.\n",
    ),
    "too few features": (
        ("--out", "new", "--observations", "3.csv"),
        "Error: Observations have shape (1, 3).\n  Policy 'tiny' needs (B, 4) or wider.\n",
    ),
    "not a number": (
        ("--out", "new", "--observations", "nan.csv"),
        "Error: nan.csv holds no observations, or a number that is not finite.\n",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused_leaves_nothing(
    qcompile: Call, policy: Call, left: Call, what: str
) -> None:
    folder_in_use()
    policy()
    Path("3.csv").write_text("1,2,3\n")
    Path("nan.csv").write_text("1,2,3,nan\n")
    before = left()
    words, text = REFUSED[what]
    answer = qcompile("export", "tiny.json", "--out", "job", *words)
    assert (answer.code, answer.out, answer.err) == (1, "", text)
    assert left() == before


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--shots", "exact"),
            "Invalid value for '--shots': 'exact' is not a valid integer.",
        ),
        (
            ("--shots", "0"),
            "Invalid value for '--shots': 0 is not in the range 1<=x<=10000000.",
        ),
        (
            ("--shots", "10000001"),
            "Invalid value for '--shots': 10000001 is not in the range 1<=x<=10000000.",
        ),
        (("--out", "tiny.json"), "Invalid value for '--out': Directory 'tiny.json' is a file."),
        (("--observations", "no.csv"), "'--observations': File 'no.csv' does not exist."),
    ],
)
def test_wrong_usage(
    qcompile: Call, policy: Call, left: Call, words: tuple[str, ...], text: str
) -> None:
    answer = qcompile("export", policy(), "--out", "new", *words)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.endswith(f"{text}\n")
    assert left() == ["tiny.json"]


def test_an_interrupted_export_leaves_nothing(
    qcompile: Call, policy: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_text(path: Path, text: str) -> None:
        path.write_bytes(text[:10].encode())
        raise KeyboardInterrupt

    name = policy()
    monkeypatch.setattr(Path, "write_text", write_text)
    assert qcompile("export", name, "--out", "job").code == 1
    assert left() == ["tiny.json"]


def test_without_out_the_job_is_a_new_folder_beside_the_caller(
    qcompile: Call, policy: Call, left: Call
) -> None:
    answer = qcompile("export", policy())
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.endswith("and job.json, in tiny-job\n")
    assert left() == ["tiny-job", "tiny-job/job.json", "tiny-job/round0.qasm", "tiny.json"]


def test_a_job_that_is_there_already_is_kept(qcompile: Call, policy: Call) -> None:
    name = policy()
    qcompile("export", name)
    before = Path("tiny-job/job.json").read_bytes()
    answer = qcompile("export", name, "--shots", 7)
    assert answer.code == 1
    assert answer.err == (
        "Error: tiny-job already exists.\n  Remove it, or choose another with --out.\n"
    )
    assert Path("tiny-job/job.json").read_bytes() == before


def test_a_policy_name_cannot_lead_out_of_the_folder(
    qcompile: Call, policy: Call, left: Call
) -> None:
    assert qcompile("export", policy(name="../../evil/x")).code == 0
    folders = {name.partition("/")[0] for name in left()} - {"tiny.json"}
    assert len(folders) == 1
    assert folders.pop().startswith("evil-x-")
