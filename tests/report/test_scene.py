"""The pictures of a film: what is drawn is what was measured, in every size and number."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rings import ring_policy

from qcompile.deploy.filming import Decision, Frame
from qcompile.deploy.play import play
from qcompile.policy import load_policy
from qcompile.report.lettering import fitted, width_of
from qcompile.report.lettering import write as write_text
from qcompile.report.scene import Scene

Make = Callable[..., Any]

BLUE, YELLOW, ORANGE, DARK = (86, 180, 233), (240, 228, 66), (230, 159, 0), (0, 114, 178)
WHITE = np.full((40, 60, 3), 255, dtype=np.uint8)


def scene(circuits: int, shots: int | None = 100, mitigation: str = "none", **named: Any) -> Scene:
    policy = SimpleNamespace(name=named.get("name", "lander"), hold=named.get("hold", 1))
    player = SimpleNamespace(
        policy=policy,
        backend="fake_lima",
        kind="noise-model",
        settings=SimpleNamespace(shots=shots, mitigation=mitigation),
        sizes=lambda: {"circuits_per_step": circuits},
        executable=None,
    )
    return Scene(player)  # type: ignore[arg-type]


def frame(
    z: Any,
    ideal: Any,
    probabilities: Any,
    action: int = 0,
    picture: np.ndarray = WHITE,
    **more: Any,
) -> Frame:
    names = more.pop("names", tuple(f"a{i}" for i in range(len(probabilities))))
    values = [np.array(one, dtype=float) for one in (z, ideal, probabilities)]
    number = more.pop("number", 0)
    step, reward = more.pop("step", 1), more.pop("reward", 0.0)
    return Frame(picture, 30.0, step, reward, action, names, Decision(number, *values), **more)


def where(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.asarray((picture == colour).all(axis=2))


def bars(picture: np.ndarray, colour: tuple[int, int, int] = BLUE) -> list[tuple[int, int]]:
    """Top and bottom row of each bar below the legend, from left to right."""
    found = where(picture, colour)
    found[: np.flatnonzero(found.any(axis=1))[0] + 14] = False  # the square of the legend
    columns = np.flatnonzero(found.any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    rows = (np.flatnonzero(found[:, group[0]]) for group in groups if len(group))
    return [(int(row[0]), int(row[-1])) for row in rows]


def levels(picture: np.ndarray, zero: int, one: int) -> list[float]:
    """The values that bars show, where the rows of 0 and 1 are known."""
    ends = (top if bottom == zero else bottom for top, bottom in bars(picture))
    return [(zero - end) / (zero - one) for end in ends]


def test_the_height_of_a_bar_is_its_value() -> None:
    """Measured with bars of 1 and -1 as the yardstick; the markers are out of the way."""
    z = [1.0, 0.5, -1.0, -0.25, 0.8]
    picture = scene(5).draw(frame(z, [-1, -1, 1, 1, -1], [0.5, 0.5]))
    found = bars(picture)
    zero, one, minus_one = found[0][1], found[0][0], found[2][1]
    assert zero - one == minus_one - zero
    assert zero - one >= 50, "bars too small to be read"
    np.testing.assert_allclose(levels(picture, zero, one), z, atol=1 / (zero - one))


def test_the_marker_is_at_the_ideal() -> None:
    z = [1.0, 0.5, -1.0, -0.25]
    ideal = [-1.0, -0.5, 0.0, 1.0]
    picture = scene(4).draw(frame(z, ideal, [0.5, 0.5]))
    (zero_bar, *_), found = bars(picture), where(picture, YELLOW)
    zero, unit = zero_bar[1], zero_bar[1] - zero_bar[0]
    found[: zero - unit - 10] = False  # the legend
    columns = np.flatnonzero(found.any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    assert len(groups) == 4
    middles = [np.flatnonzero(found[:, group].any(axis=1)).mean() for group in groups]
    np.testing.assert_allclose([(zero - row) / unit for row in middles], ideal, atol=1 / unit)


def test_a_film_shows_what_the_policy_gives(cartpole: Make, deploy: Make) -> None:
    """Bars decoded from the picture of a played step are -sin(arctan(u)), by hand.

    On `ideal`, exact: measured and ideal are the same, and the marker covers the end of its bar.
    Its observation is the first of seed 5.
    """
    import gymnasium

    frames: list[Frame] = []
    player = deploy(replace(cartpole()), "ideal", seed=5, max_steps=1)
    play(player, 1, on_frame=frames.append)
    observation, _ = gymnasium.make("CartPole-v1").reset(seed=5)
    u = np.array([1.0, 1.0, 4.0, 2.0]) * observation.astype(float)
    expected = -u / np.sqrt(1 + u**2)
    picture = Scene(player).draw(frames[0])
    yardstick = scene(4).draw(frame([1, 1, 1, 1], [-1] * 4, [0.5, 0.5], picture=frames[0].picture))
    top, zero = bars(yardstick)[0]
    found = where(picture, YELLOW)
    found[: top - 10] = False
    columns = np.flatnonzero(found.any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    middles = [np.flatnonzero(found[:, group].any(axis=1)).mean() for group in groups]
    shown = [(zero - row) / (zero - top) for row in middles]
    np.testing.assert_allclose(shown, expected, atol=1.01 / (zero - top))


def test_the_action_taken_stands_out() -> None:
    """Bars of the probabilities: orange for the one taken, as wide as it was likely."""
    wide = np.full((400, 600, 3), 255, dtype=np.uint8)
    picture = scene(3).draw(frame([0] * 3, [0] * 3, [0.2, 0.7, 0.1], action=1, picture=wide))

    def longest(colour: tuple[int, int, int]) -> int:
        return int(where(picture, colour)[:, 400:].sum(axis=1).max())

    assert longest(ORANGE) / longest(DARK) == pytest.approx(0.7 / 0.2, rel=0.05)
    rows = [np.flatnonzero(where(picture, c)[:, 450:].any(axis=1)) for c in (DARK, ORANGE)]
    assert rows[0].min() < rows[1].min() < rows[0].max(), "the second of three is taken"


def test_many_actions_have_columns() -> None:
    odds = np.full(20, 0.02)
    odds[13] = 1 - 19 * 0.02
    picture = scene(24).draw(frame([0.5] * 24, [0.4] * 24, odds, action=13))
    taken, other = (where(picture, colour).sum(axis=0).max() for colour in (ORANGE, DARK))
    assert taken / other == pytest.approx(0.62 / 0.02, rel=0.35)  # rows of pixels: 79 and 3 or 4
    assert np.count_nonzero(where(picture, DARK).any(axis=0)) > 19 * 10


@pytest.mark.parametrize("circuits", [0, 1, 2, 24, 60, 61, 200, 1000])
@pytest.mark.parametrize("actions", [1, 2, 5, 6, 9, 20, 64])
def test_any_number_fits(circuits: int, actions: int) -> None:
    odds = np.full(actions, 1 / actions)
    z = np.linspace(-1.3, 1.3, circuits)
    shown = scene(circuits).draw(frame(z, z[::-1], odds, action=actions - 1))
    assert shown.shape[1:] == (640, 3)
    assert shown.shape[0] % 2 == 0
    assert shown.shape[0] <= 900
    # Nothing reaches the rim: what is written or drawn ends within the margins.
    rim = np.concatenate([shown[:, :12].reshape(-1, 3), shown[:, -12:].reshape(-1, 3)])
    assert (rim == shown[0, 0]).all()


@pytest.mark.parametrize(
    "size",
    [(400, 600), (500, 500), (63, 95), (2, 2), (2, 900), (900, 2), (210, 160), (1501, 2003)],
)
def test_any_size_of_frames_fits(size: tuple[int, int]) -> None:
    rendered = np.full((*size, 3), 200, dtype=np.uint8)
    shown = scene(4).draw(frame([0] * 4, [0] * 4, [0.5, 0.5], picture=rendered))
    grey = where(shown, (200, 200, 200))
    assert grey.any()
    rows, columns = (np.flatnonzero(grey.any(axis=axis)) for axis in (1, 0))
    ratio = (columns[-1] - columns[0] + 1) / (rows[-1] - rows[0] + 1)
    if min(size) > 10:
        assert ratio == pytest.approx(size[1] / size[0], rel=0.02)


def test_a_picture_nearly_as_large_as_its_place_keeps_its_pixels() -> None:
    """CartPole's and the lander's frames do, and so their lines of one pixel."""
    rendered = np.full((400, 600, 3), 255, dtype=np.uint8)
    rendered[299] = 0
    shown = scene(4).draw(frame([0] * 4, [0] * 4, [0.5, 0.5], picture=rendered))
    top, left = (int(i[0]) for i in np.nonzero(where(shown, (255, 255, 255))))
    np.testing.assert_array_equal(shown[top : top + 400, 20:620], rendered)
    assert left == 20


def test_frames_may_change_their_size() -> None:
    one = scene(2)
    shown = [
        one.draw(frame([0] * 2, [0] * 2, [0.5, 0.5], picture=np.zeros((*size, 3), np.uint8)))
        for size in ((400, 600), (300, 900), (500, 100))
    ]
    assert len({picture.shape for picture in shown}) == 1


def differs(first: Scene, second: Scene, **changes: Any) -> np.ndarray:
    """Which pixels of a frame's head differ."""
    values = {"z": [0.1] * 4, "ideal": [0.1] * 4, "probabilities": [0.5, 0.5]}
    pictures = [first.draw(frame(**values)), second.draw(frame(**values, **changes))]
    return np.asarray((pictures[0] != pictures[1]).any(axis=2))


def test_the_head_says_policy_shots_step_and_reward() -> None:
    """Each in its own corner: left and right, first and second line."""
    assert not differs(scene(4), scene(4)).any()
    corners = {
        "policy": differs(scene(4), scene(4, name="other")),
        "reward": differs(scene(4), scene(4), reward=7.0),
        "shots": differs(scene(4), scene(4, shots=4)),
        "step": differs(scene(4), scene(4), step=77),
    }
    places = {"policy": (0, 0), "reward": (0, 1), "shots": (1, 0), "step": (1, 1)}
    for name, changed in corners.items():
        rows, columns = np.nonzero(changed[:76])
        assert len(rows)
        line, side = places[name]
        assert {int(row) // 42 for row in rows} == {line}
        assert {int(column) // 320 for column in columns} == {side}


def test_a_held_decision_is_numbered() -> None:
    first, second = (
        scene(1, hold=3).draw(frame([0.1], [0.1], [0.5, 0.5], step=4, number=number))
        for number in (1, 2)
    )
    assert (first != second).any()


def test_bars_say_whether_they_are_mitigated() -> None:
    pictures = [
        scene(4, shots, mitigation).draw(frame([0.1] * 4, [0.1] * 4, [0.5, 0.5]))[480:]
        for shots, mitigation in ((9, "none"), (9, "readout"), (None, "none"))
    ]
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[0] != pictures[2]).any()


def test_a_network_has_no_bars_of_z() -> None:
    shown = scene(0, None).draw(frame([], [], [0.25, 0.75], action=1))
    assert not where(shown, BLUE).any()
    assert not where(shown, YELLOW).any()
    assert where(shown, ORANGE).any()


def test_circuits_of_several_qubits_have_a_map_and_names(deploy: Make, tmp_path: Path) -> None:
    """Below the bars, where the device has couplings; observables are named where they fit."""
    path = tmp_path / "ring.json"
    path.write_text(json.dumps(ring_policy()))
    policy = load_policy(path)
    shown = []
    for backend in ("ideal", "fake_lima"):
        frames: list[Frame] = []
        player = deploy(policy, backend, max_steps=1)
        play(player, 1, on_frame=frames.append)
        shown.append(Scene(player).draw(frames[0]))
    plain, mapped = shown
    assert len(mapped) == len(plain) + 190
    blue = where(mapped[len(plain) :], BLUE)
    assert blue.sum() > 2000, "four qubits and their couplings"


def test_text_that_is_too_long_is_cut() -> None:
    text = fitted("a name that\nis much\x1b too long", 100, 18)
    assert text.endswith("…")
    assert width_of(text, 18) <= 100
    assert "\n" not in text
    assert fitted("short", 100, 18) == "short"
    assert fitted("xxxx", 1, 18) == "…"


def test_text_beyond_the_picture_is_cut_off() -> None:
    picture = np.zeros((10, 20, 3), dtype=np.uint8)
    write_text(picture, "words", 5, 2, 18, (255, 0, 0))
    assert picture[..., 0].any()
    assert not picture[..., 1].any()
    write_text(picture, "words", 5, 30, 18, (0, 255, 0))
    assert not picture[..., 1].any()
