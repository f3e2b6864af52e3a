"""`qcompile run`: what it answers, what it refuses and how, and what Ctrl-C leaves."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
import torch

Call = Callable[..., Any]

DOCUMENTED = {
    *("policy", "environment", "backend", "kind", "shots", "mitigation", "level", "seed"),
    *("episodes", "mean_reward", "std_reward", "ci95", "solved", "gates_per_circuit"),
    *("circuits_per_step", "rounds_per_step", "executions", "qpu_seconds_estimate", "env_steps"),
    "wall_seconds",
}
"""The contract; those below came later."""

LATER = {"greedy", "interrupted", "predistort", "calibration", "copies"}


def test_a_run_is_reported_in_words(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 5, "--backend", "ibm_lima")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("tiny in CartPole-v1 on ibm_lima (noise model)\n")
    assert "over 5 episodes (95 % interval" in answer.out
    few = qcompile("run", policy(), "--episodes", 1)
    assert "over 1 episode" in few.out
    assert "interval" not in few.out


def test_the_json_document_holds_the_contract(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 3, "--seed", 5, "--shots", 100, "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert set(found) == DOCUMENTED | LATER
    assert [episode["seed"] for episode in found["episodes"]] == [5, 6, 7]
    assert all(set(episode) == {"seed", "reward", "length"} for episode in found["episodes"])
    rewards = [episode["reward"] for episode in found["episodes"]]
    assert rewards == [episode["length"] for episode in found["episodes"]]  # CartPole pays 1 a step
    assert found["mean_reward"] == pytest.approx(np.mean(rewards))
    assert found["std_reward"] == pytest.approx(np.std(rewards))
    assert min(rewards) <= found["ci95"][0] <= found["ci95"][1] <= max(rewards)
    assert set(found["gates_per_circuit"]) == {"sx", "rz", "x", "rx"}
    expected = {
        "policy": "tiny",
        "environment": "CartPole-v1",
        "backend": "ideal",
        "kind": "ideal",
        "shots": 100,
        "mitigation": "none",
        "level": 2,
        "seed": 5,
        "greedy": False,
        "solved": None,
        "interrupted": False,
        "predistort": False,
        "calibration": None,
        "copies": 1,
        "circuits_per_step": 4,
        "rounds_per_step": 1,
        "env_steps": sum(rewards),
        "executions": sum(rewards) * 100,
    }
    assert {key: found[key] for key in expected} == expected


def test_a_run_repeats_exactly(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(), "--episodes", 3, "--backend", "fake_lima", "--shots", 64, "--json")
    documents = [qcompile(*words, "--seed", seed).json() for seed in (7, 7, 8)]
    for document in documents:
        del document["wall_seconds"]
    assert documents[0] == documents[1]
    assert documents[0]["episodes"] != documents[2]["episodes"]


def test_an_alias_names_the_device_and_its_cost_is_counted(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 2, "--backend", "ibmq_lima", "--json")
    found = answer.json()
    assert (found["backend"], found["kind"]) == ("ibm_lima", "noise-model")
    assert found["mitigation"] == "readout"
    # 4 circuits fit side by side on 5 qubits; the calibration is one job of 6 x 8192;
    # every step of the longest episode is one job. IBM: 2 s for each job, 0.35 ms for each.
    assert found["rounds_per_step"] == 1
    assert found["executions"] == 8192 * found["env_steps"] + 6 * 8192
    jobs = 1 + max(episode["length"] for episode in found["episodes"])
    expected = 2 * jobs + 0.00035 * found["executions"]
    assert found["qpu_seconds_estimate"] == pytest.approx(expected)


def test_exact_expectations_cost_nothing(qcompile: Call, policy: Call) -> None:
    words = ("run", policy(), "--episodes", 1, "--shots", "exact", "--greedy", "--json")
    found = qcompile(*words).json()
    assert (found["shots"], found["greedy"], found["executions"]) == ("exact", True, 0)
    assert found["qpu_seconds_estimate"] is None


def test_circuits_that_do_not_fit_take_rounds(qcompile: Call, policy: Call) -> None:
    wide = policy(
        circuits=[[["ry", "x0"]]] * 8, weights=[[1.0] * 8, [0.0] * 8], theta=[], bias=[0.0, 0.0]
    )
    words = ("run", wide, "--episodes", 1, "--backend", "ibm_lima", "--mitigation", "none")
    found = qcompile(*words, "--json").json()
    assert found["rounds_per_step"] == 2
    assert found["executions"] == 2 * 8192 * found["env_steps"]


def test_names_are_shown_as_they_are(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(name="[/red] [bold]"), "--episodes", 1)
    assert answer.code == 0
    assert answer.out.startswith("[/red] [bold] in CartPole-v1")


# Calibrations, twins, predistortion, copies.


LIMA = ("--backend", "fake_lima", "--episodes", 2)


@pytest.mark.parametrize("mitigation", ["readout", "response"])
def test_a_calibration_of_a_file_costs_nothing_again(
    qcompile: Call, policy: Call, calibration: str, mitigation: str
) -> None:
    words = ("run", policy(), *LIMA, "--mitigation", mitigation, "--json")
    answer = qcompile(*words, "--calibration", calibration)
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert (found["mitigation"], found["calibration"]) == (mitigation, calibration)
    assert found["executions"] == 8192 * found["env_steps"]
    measured = qcompile(*words).json()
    assert measured["calibration"] is None
    circuits = {"readout": 6, "response": 8}[mitigation]  # 4 qubits: 2 + 2 log2(4) patterns
    assert measured["executions"] == 8192 * (measured["env_steps"] + circuits)


def test_a_twin_plays_its_calibration(qcompile: Call, policy: Call, calibration: str) -> None:
    words = ("run", policy(), "--backend", calibration, "--episodes", 2)
    found = qcompile(*words, "--json").json()
    assert (found["backend"], found["kind"]) == ("fake_lima", "measured-response")
    assert found["mitigation"] == "readout"
    assert found["executions"] == 8192 * found["env_steps"]  # its own calibration mitigates
    again = qcompile(*words, "--json", "--shots", "exact", "--mitigation", "response").json()
    assert (again["shots"], again["mitigation"]) == ("exact", "response")
    assert "on fake_lima (twin of its calibration)" in qcompile(*words).out


def test_bent_angles_are_not_undone(qcompile: Call, policy: Call, calibration: str) -> None:
    words = ("run", policy(), *LIMA, "--predistort", "--calibration", calibration)
    found = qcompile(*words, "--json").json()
    assert (found["predistort"], found["mitigation"]) == (True, "none")
    assert "bent angles by lima.json" in qcompile(*words).out


def test_copies_share_executions(qcompile: Call, policy: Call) -> None:
    narrow = policy(
        circuits=[[["ry", "x0"]]] * 2, weights=[[1.0] * 2, [0.0] * 2], theta=[], bias=[0.0, 0.0]
    )
    words = ("run", narrow, "--backend", "fake_lima", "--mitigation", "none", "--episodes", 2)
    found = qcompile(*words, "--copies", 2, "--shots", 100, "--json").json()
    assert (found["copies"], found["rounds_per_step"]) == (2, 1)
    longest = max(episode["length"] for episode in found["episodes"])
    assert found["executions"] == 100 * longest
    assert "side by side  2 episodes" in qcompile(*words, "--copies", 2).out


def test_an_old_calibration_is_reported(qcompile: Call, policy: Call, calibration: str) -> None:
    values = json.loads(Path(calibration).read_text())
    Path("old.json").write_text(json.dumps(values | {"created": "2020-01-01T00:00:00Z"}))
    answer = qcompile("run", policy(), *LIMA, "--calibration", "old.json", "--json")
    assert answer.code == 0
    assert answer.err.startswith("old.json is ")
    assert " hours old; `qcompile calibrate " in answer.err
    assert answer.json()["calibration"] == "old.json"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--predistort", "--mitigation", "readout"), "--predistort and --mitigation readout excl"),
        (("--calibration", "lima.json", "--mitigation", "none"), "--calibration needs --mitigati"),
        (("--calibration", "lima.json"), "--calibration needs --mitigation"),  # ideal has none
        (("--copies", "0"), "0 is not in the range 1<=x<=10000"),
    ],
)
def test_contradictions_are_wrong_usage(
    qcompile: Call, policy: Call, words: tuple[str, ...], text: str
) -> None:
    answer = qcompile("run", policy(), *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--backend", "ibm_lima", "--calibration", "lima.json"),
            "The calibration is of fake_lima, the backend is ibm_lima.\n  Measure one with",
        ),
        (
            ("--mitigation", "response", "--level", "1", "--calibration", "lima.json"),
            "Response curves need level 2, found level 1.",
        ),
        (("--predistort", "--level", "1"), "Response curves need level 2, found level 1."),
        (("--calibration", "bad.json"), "bad.json is no calibration.\n  the file: invalid JSON: "),
        (("--calibration", "nosuch.json"), "nosuch.json is no calibration.\n"),
        (
            ("--calibration", "two.json"),
            "Qubit 2 has no calibration.\n  Calibrated on fake_lima: 0",
        ),
        (
            ("--calibration", "two.json", "--mitigation", "response"),
            "Qubit 2 has no calibration.\n",
        ),
        (("--backend", "two.json"), "The calibration of fake_lima holds no response curves.\n"),
        (("--backend", "lima.json", "--level", "1"), "A measured response knows sx rz sx, found "),
    ],
)
def test_calibrations_that_do_not_fit_are_explained(
    qcompile: Call, policy: Call, calibration: str, words: tuple[str, ...], text: str
) -> None:
    two = ("calibrate", "--backend", "fake_lima", "--qubits", "0,1", "--parts", "readout")
    assert qcompile(*two, "--out", "two.json").code == 0
    Path("bad.json").write_text(Path(calibration).read_text()[:300])
    answer = qcompile("run", policy(), *LIMA, *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")


def test_a_sampler_has_shots_alone(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--backend", "qiskit:FakeLimaV2", "--shots", "exact")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: fake_lima runs through a sampler, which only has shots.\n")


# What is refused.


class Code:
    """Pickled, this runs a command when it is opened."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("ran",)


def truncated(path: Path) -> None:
    torch.save({"theta": torch.zeros(100)}, path)
    path.write_bytes(path.read_bytes()[:500])


BAD_PT: dict[str, tuple[Callable[[Path], object], str]] = {
    "code": (
        lambda path: torch.save({"theta": Code()}, path),
        """\
Error: bad.pt holds more than tensors and plain values, and was not loaded.
  A pickle can carry code that runs when it is opened.
  Save the policy with qcompile, or as JSON.
""",
    ),
    "bare pickle": (
        lambda path: path.write_bytes(pickle.dumps(Code())),
        """\
Error: bad.pt cannot be read as a .pt file: it is a bare pickle, and was not loaded.
  A pickle can carry code that runs when it is opened.
  Save the policy with qcompile, or as JSON.
""",
    ),
    "truncated": (
        truncated,
        """\
Error: bad.pt cannot be read as a .pt file; it may be truncated.
  Copy or train it again.
""",
    ),
}


@pytest.mark.parametrize("what", BAD_PT)
def test_bad_pt_files_are_explained(qcompile: Call, left: Call, what: str) -> None:
    make, text = BAD_PT[what]
    make(Path("bad.pt"))
    answer = qcompile("run", "bad.pt")
    assert (answer.code, answer.out, answer.err) == (1, "", text)
    assert left() == ["bad.pt"]


BAD_POLICIES: dict[str, tuple[dict[str, Any], str]] = {
    "wrong shape": (
        {"weights": [[1.0, 2.0], [3.0, 4.0]]},
        """\
Error: tiny.json is no policy file.
  weights has shape (2, 2).
    It needs (2, 4).
""",
    ),
    "uneven rows": (
        {"weights": [[1.0, 2.0], [3.0]]},
        """\
Error: tiny.json is no policy file.
  weights has rows of different lengths.
""",
    ),
    "unknown gate": (
        {"circuits": [[["h"], ["cx"]]] * 4},
        """\
Error: tiny.json is no policy file.
  circuits.0: Unknown gate 'cx'.
    Known gates: id x y z h s sdg t tdg sx sxdg rx ry rz p.
    Did you mean x?
""",
    ),
    "unknown symbol": (
        {"circuits": [[["ry", "x9"]]] * 4},
        """\
Error: tiny.json is no policy file.
  Unknown symbol 'x9' in circuit 0.
    Declared: theta0 x0 x1 x2 x3.
""",
    ),
    "not a number": (
        {"theta": [float("nan")]},
        """\
Error: tiny.json is no policy file.
  theta.0: input should be a finite number (found nan)
""",
    ),
    "too few features": (
        {"encoder": {"function": "tanh", "feature": [0, 1, 2, 7], "scale": [1.0] * 4}},
        """\
Error: Policy 'tiny' reads feature 7; observations of CartPole-v1 have 4 features.
  Correct `environment` or `encoder.feature` in the policy file.
""",
    ),
    "too few actions": (
        {"environment": "Acrobot-v1"},
        """\
Error: Policy 'tiny' has 2 actions; Acrobot-v1 has 3.
  Correct `environment`, or `weights` and `bias`, in the policy file.
""",
    ),
    "angles out of range": (
        {"encoder": {"function": "identity", "feature": [0, 1, 2, 3], "scale": [1.7e308] * 4}},
        """\
Error: tiny.json is no policy file.
  encoder.scale has an entry of 1.7e+308.
    Scales lie within 1e+09: more turns every angle into noise.
""",
    ),
    "no numbered actions": (
        {"environment": "Pendulum-v1"},
        """\
Error: Pendulum-v1 acts in Box(-2.0, 2.0, (1,), float32).
  A policy chooses among numbered actions (Discrete).
""",
    ),
}


def test_an_environment_that_names_a_module_is_refused(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("trojan.py").write_text("open('ran', 'w')")
    monkeypatch.syspath_prepend(Path.cwd())
    answer = qcompile("run", policy(environment="trojan:CartPole-v1"))
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Environment 'trojan:CartPole-v1' names a module to import.
  A policy file may not load code; register the environment and give its plain name.
"""
    )
    assert not Path("ran").exists()
    assert "trojan" not in sys.modules


@pytest.mark.parametrize("what", BAD_POLICIES)
def test_bad_policies_are_explained(qcompile: Call, policy: Call, what: str) -> None:
    changes, text = BAD_POLICIES[what]
    answer = qcompile("run", policy(**changes), "--episodes", 20)
    assert (answer.code, answer.out, answer.err) == (1, "", text)


def test_a_file_that_is_no_json_is_explained(qcompile: Call) -> None:
    Path("bad.json").write_text('{"format": ')
    answer = qcompile("run", "bad.json")
    assert answer.code == 1
    assert answer.err.startswith("Error: bad.json is no policy file.\n  the file: invalid JSON: ")


@pytest.mark.parametrize("name", ["nosuch", "folder", "no/such.pt", "x" * 500, "", "ñ💥"])
def test_an_unknown_policy_is_explained(qcompile: Call, name: str) -> None:
    Path("folder").mkdir()
    answer = qcompile("run", name)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: Unknown policy {name!r}.\n  ")
    assert answer.err.endswith("  A path to a .pt or .json policy file works too.\n")


def test_an_unknown_backend_is_explained_with_the_nearest(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--backend", "ibm_lime")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: Unknown backend 'ibm_lime'.
  Did you mean ibm_lima or ibm_lagos or ibm_belem?
  A path to a device file works too; `qcompile backends` lists what is there.
"""
    )


@pytest.mark.parametrize("shots", [0, -1, 10**9])
def test_shots_out_of_range_are_wrong_usage(qcompile: Call, policy: Call, shots: int) -> None:
    answer = qcompile("run", policy(), "--shots", shots)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.endswith(
        f"Error: Invalid value for '--shots': {shots} shots cannot be run; the number lies in "
        "[1, 10000000] (1024 and 8192 are usual), or say 'exact'.\n"
    )


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--shots", "1e3"), "'1e3' is neither a number nor 'exact'"),
        (("--shots", "nan"), "'nan' is neither a number nor 'exact'"),
        (("--episodes", "0"), "0 is not in the range 1<=x<=10000"),
        (("--episodes", "10001"), "10001 is not in the range 1<=x<=10000"),
        (("--video", "a.avi"), "Invalid value for '--video': a.avi must end with .mp4 or .gif."),
        (("--video", "a"), "Invalid value for '--video': a must end with .mp4 or .gif."),
        (("--seed", "-1"), "-1 is not in the range x>=0"),
        (("--level", "3"), "3 is not in the range 0<=x<=2"),
        (("--mitigation", "magic"), "'magic' is not one of 'none', 'readout'"),
        (("--nosuch",), "No such option '--nosuch'"),
        (("one", "more"), "unexpected extra arguments"),
    ],
)
def test_wrong_usage(qcompile: Call, policy: Call, words: tuple[str, ...], text: str) -> None:
    answer = qcompile("run", policy(), *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err


# Films.


def test_a_film_is_written_whole(qcompile: Call, policy: Call, left: Call) -> None:
    words = ("run", policy(), "--episodes", 2, "--json", "--video", "films/a.gif")
    answer = qcompile(*words)
    assert (answer.code, answer.err) == (0, "film of the first episode in films/a.gif\n")
    assert len(answer.json()["episodes"]) == 2
    assert left() == ["films", "films/a.gif", "tiny.json"]
    assert Path("films/a.gif").read_bytes()[:6] == b"GIF89a"


def test_a_film_has_the_rate_of_the_environment(qcompile: Call, policy: Call) -> None:
    acrobot = policy(
        environment="Acrobot-v1", weights=[[1.0] * 4, [0.0] * 4, [0.0] * 4], bias=[0.0] * 3
    )
    assert qcompile("run", acrobot, "--episodes", 1, "--video", "a.mp4").code == 0
    frames, seconds = imageio_ffmpeg.count_frames_and_secs("a.mp4")
    assert frames / seconds == pytest.approx(15, rel=1e-3)


def test_without_a_frame_there_is_no_film(
    qcompile: Call, policy: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def act(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("qcompile.rl.evaluate.Deployment.act", act)
    answer = qcompile("run", policy(), "--video", "a.gif")
    assert answer.code == 1
    assert answer.err.startswith("Error: Interrupted: 0 of 20 episodes were finished.")
    assert left() == ["tiny.json"]


BAD_FILMS = {
    "tiny.json/a.gif": """\
Error: Cannot write tiny.json/a.gif.
  tiny.json is no folder.
  Choose another path.
""",
}


@pytest.fixture
def nothing_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(*_: object, **__: object) -> None:
        pytest.fail("played before the output was checked")

    monkeypatch.setattr("qcompile.rl.evaluate.play", play)


@pytest.mark.usefixtures("nothing_is_played")
@pytest.mark.parametrize("name", BAD_FILMS)
def test_a_film_that_cannot_be_written_is_refused_at_once(
    qcompile: Call, policy: Call, left: Call, name: str
) -> None:
    answer = qcompile("run", policy(), "--video", name)
    assert (answer.code, answer.out, answer.err) == (1, "", BAD_FILMS[name])
    assert left() == ["tiny.json"]


@pytest.mark.usefixtures("nothing_is_played")
@pytest.mark.parametrize("film", ["a.gif", "a.mp4"])
@pytest.mark.parametrize("package", ["imageio", "imageio_ffmpeg"])
def test_a_missing_extra_is_named_at_once(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch, package: str, film: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    answer = qcompile("run", policy(), "--video", film)
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: A film needs packages that are not installed.
  Install them with: pip install 'qcompile[video]'
"""
    )


# Ctrl-C.


def test_an_interrupted_run_reports_what_is_finished(
    qcompile: Call, policy: Call, ctrl_c: Call
) -> None:
    ctrl_c(2)
    answer = qcompile("run", policy(), "--episodes", 50)
    assert answer.code == 1
    assert "over 2 episodes" in answer.out
    assert "interval" not in answer.out
    assert (
        answer.err
        == """\
Error: Interrupted: 2 of 50 episodes were finished.
  These are the shortest ones, so their mean is no estimate of the policy's score.
  Fewer --episodes end sooner.
"""
    )


def test_an_interrupted_run_is_still_one_json_document(
    qcompile: Call, policy: Call, ctrl_c: Call
) -> None:
    ctrl_c(3)
    answer = qcompile("run", policy(), "--episodes", 50, "--json")
    assert answer.code == 1
    found = answer.json()
    assert set(found) == DOCUMENTED | LATER
    assert found["ci95"] is None  # the shortest episodes end first: no estimate
    assert found["solved"] is None
    assert (found["interrupted"], len(found["episodes"])) == (True, 3)


INTERRUPTED_AT_ONCE = """
import os, signal
from qcompile.cli import main
from qcompile.rl import evaluate

act = evaluate.Deployment.act
def interrupted(self, observations):
    os.kill(os.getpid(), signal.SIGINT)
    return act(self, observations)
evaluate.Deployment.act = interrupted
main()
"""


def test_a_process_interrupted_before_any_episode_is_finished(policy: Call) -> None:
    words = [sys.executable, "-W", "error", "-c", INTERRUPTED_AT_ONCE, "run", policy(), "--json"]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1
    found = json.loads(ended.stdout)
    assert found["interrupted"] is True
    assert found["episodes"] == []
    assert [found[key] for key in ("mean_reward", "std_reward", "ci95")] == [None] * 3
    assert "Interrupted: 0 of 20 episodes were finished." in ended.stderr
    assert "Traceback" not in ended.stderr
