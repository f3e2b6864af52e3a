"""Figures as files, and the styles they are drawn in."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

import matplotlib as mpl
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from PIL import Image

from qcompile.errors import FigureError, OutputError
from qcompile.report.figure import SUFFIXES, Figure
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel
from qcompile.report.rewards import draw_rewards
from qcompile.report.style import HOUSE, Style
from qcompile.report.trial import Kind, check_style

SUMMARY = {
    "policy": "a $b$ <c> & d",
    "backend": "ibm_lima",
    "episodes": [{"reward": float(reward)} for reward in (1, 5, 3)],
    "mean_reward": 3.0,
    "ci95": None,
}


def figure(style: Path | None = None) -> Figure:
    return draw_rewards(SUMMARY, style)


@pytest.mark.parametrize(
    ("name", "start"), [("a.png", b"\x89PNG"), ("a.svg", b"<svg"), ("a.pdf", b"%PDF")]
)
def test_the_suffix_says_what_a_file_is(tmp_path: Path, name: str, start: bytes) -> None:
    """Drawn twice, it is the same file: it holds no date, and its names do not change."""
    first, second = tmp_path / name, tmp_path / f"second-{name}"
    figure().save(first)
    figure().save(second)
    assert first.read_bytes().startswith(start)
    assert first.read_bytes() == second.read_bytes()
    assert b"2026" not in first.read_bytes()


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.PNG", "a.svg.gz"])
def test_other_suffixes_are_refused_in_words(tmp_path: Path, name: str) -> None:
    with pytest.raises(FigureError, match=r"must end with \.png, \.svg or \.pdf\.$"):
        figure().save(tmp_path / name)
    assert not [*tmp_path.iterdir()]


def test_a_file_that_cannot_be_written_is_an_error_of_the_output(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError):
        figure().save(tmp_path / "file" / "a.png")


def test_a_notebook_shows_the_png() -> None:
    shown = figure()
    assert shown._repr_png_() == shown.png
    with Image.open(BytesIO(shown.png)) as picture:
        assert picture.width == 1020, "3.4 inches at 300 dots an inch"
        assert "Software" not in picture.info


def test_svg_keeps_its_words_and_no_names_of_its_own() -> None:
    """Words stay words, as they are; two figures on one page share no id of a group."""
    text = figure().svg()
    root = ElementTree.fromstring(text)
    words = ["".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "a $b$ <c> & d on ibm_lima" in words
    assert not re.search(r'id="(figure|axes|patch|text|line2d)_\d', text)


def test_the_fonts_of_a_pdf_are_embedded_as_true_type() -> None:
    """Journals refuse fonts of type 3."""
    assert b"/Type3" not in figure().pdf()
    assert b"/FontFile2" in figure().pdf()


def points(size: float | str) -> float:
    """A font size of the style that is applied, in points."""
    return float(FontProperties(size=size).get_size_in_points())


def test_no_font_of_the_house_is_below_seven_points_in_print() -> None:
    with Style.of(None).applied():
        for name, size in Style.of(None).settings.items():
            if "size" in name and name.split(".")[0] in (
                "font",
                "axes",
                "legend",
                "xtick",
                "ytick",
            ):
                assert "major" in name or points(size) >= 7, name


def test_the_sizes_of_all_words_follow_the_font_size(tmp_path: Path) -> None:
    """Twice the size of the house's font is twice the size of every word of a figure."""
    panel = Panel("mine", [Interval("lima", "none", "32 shots", 1.0, 0.5, 1.5)], None, 1.2)
    sizes = []
    for style in (None, write(tmp_path, "font.size: 17\n")):
        drawing = draw_intervals("A title", [panel], style)._drawing
        words = [text for text in drawing.findobj(Text) if text.get_text()]
        sizes.append({text.get_text(): text.get_size() for text in words})
    house, twice = sizes
    assert {"A title", "mine", "lima", "1.2", "solved"} <= house.keys() & twice.keys()
    for words in house.keys() & twice.keys():
        assert twice[words] == pytest.approx(2 * house[words]), words


def test_a_title_can_be_left_out(tmp_path: Path) -> None:
    assert "on ibm_lima" in figure().svg()
    assert "on ibm_lima" not in figure(write(tmp_path, "figure.titlesize: 0\n")).svg()


def test_a_title_fits_the_width_of_its_figure(tmp_path: Path) -> None:
    long = {**SUMMARY, "policy": "a rather long name of a policy, in a folder", "backend": "x"}
    title = draw_rewards(long, write(tmp_path, "figure.figsize: 2, 2\n"))._drawing._suptitle
    assert title.get_text().replace("\n", " ") == f"{long['policy']} on x"
    assert title.get_window_extent().width <= title.figure.bbox.width


def write(folder: Path, text: str) -> Path:
    path = folder / "own.mplstyle"
    path.write_text(text)
    return path


def test_a_style_file_replaces_what_it_names(tmp_path: Path) -> None:
    style = write(
        tmp_path,
        "# a journal\nfigure.figsize: 2, 2  # inches\nsavefig.dpi: 100\n"
        'axes.facecolor: "#ff0000"\naxes.prop_cycle: cycler("color", ["00ff00"])\n',
    )
    with Image.open(BytesIO(figure(style).png)) as picture:
        assert picture.width == 200
        colours = {colour for _, colour in picture.convert("RGB").getcolors(1 << 20) or []}
    assert {(255, 0, 0), (0, 255, 0)} <= colours
    assert Style.of(style).settings["legend.fontsize"] == Style.of(None).settings["legend.fontsize"]


def test_wide_figures_take_two_columns_and_their_gap(tmp_path: Path) -> None:
    assert Style.of(None).column_in == 3.4
    assert Style.of(None).page_in == 7.0
    own = Style.of(write(tmp_path, "figure.figsize: 3.3, 2\n"))
    assert own.page_in == own.column_in == 3.3, "a style's own width is that of all figures"
    assert Style.of(write(tmp_path, "font.size: 9\n")).page_in == 7.0


def test_nothing_that_matplotlib_was_told_before_matters() -> None:
    plain = figure().png
    with mpl.rc_context({"axes.facecolor": "red", "font.size": 30, "savefig.dpi": 10}):
        assert figure().png == plain
        assert mpl.rcParams["axes.facecolor"] == "red", "and it stays as it was"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("text.usetex: True\n", "line 1: text.usetex does not say how a figure looks: remove it."),
        ("\nbackend: module://own\n", "line 2: backend does not say how a figure looks"),
        ("figure.hooks: own:hook\n", "figure.hooks does not say how a figure looks"),
        ("font.sise: 7\n", "line 1: matplotlib has no setting 'font.sise'."),
        ("font.size: big\n", "line 1: font.size: Could not convert 'big' to float."),
        ("font.size 7\n", "line 1: it is not NAME: VALUE."),
        ("figure.figsize: 1000, 2\n", "figures are between 0.5 and 40 inches."),
        ("savefig.dpi: 100000\n", "savefig.dpi is between 30 and 1200."),
        ("axes.prop_cycle: ().__class__\n", "a cycle is made with cycler(...) alone."),
        ("axes.prop_cycle: cycler(color=print(1))\n", "a cycle has plain values in lists."),
        ("axes.prop_cycle: cycler(nosuch=[1])\n", "line 1: "),
        ("axes.ymargin: -0.6\n", "line 1: Value must be >-0.5; got -0.6."),
        ("savefig.bbox: tight\nsavefig.pad_inches: 1e6\n", "pad_inches is between 0 and 5."),
    ],
)
def test_what_is_wrong_with_a_style_is_told_in_words(
    tmp_path: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FigureError) as error:
        figure(path)
    assert str(error.value).startswith(f"{path}, line ")
    assert words in str(error.value)
    assert capsys.readouterr() == ("", ""), "nothing ran, and matplotlib said nothing itself"


def test_a_style_that_is_not_there_or_no_style(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match=r"^Cannot read .*\.mplstyle\.\n  No such file"):
        figure(tmp_path / "no.mplstyle")
    with pytest.raises(FigureError, match=r"must end with \.mplstyle\.$"):
        figure(tmp_path / "no.txt")
    (tmp_path / "own.mplstyle").write_bytes(b"\xff\n")
    with pytest.raises(FigureError, match="is not a style file"):
        figure(tmp_path / "own.mplstyle")


def test_a_style_without_room_is_told_in_words(tmp_path: Path) -> None:
    style = write(tmp_path, "figure.figsize: 0.5, 0.5\nfont.size: 40\naxes.labelsize: 40\n")
    with pytest.raises(FigureError, match=r"^The style leaves no room"):
        figure(style).save(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("text", "words", "kinds"),
    [
        ("axes.prop_cycle: cycler('color', [])\n", "ZeroDivisionError", get_args(Kind)),
        ('path.effects: [("x",)]\n', "AttributeError", get_args(Kind)),
        (
            "lines.dashed_pattern: 0,0\nlines.linestyle: --\n",
            "ValueError: At least one value",
            ("curves", "plan", "rewards"),  # which have dashed lines
        ),
    ],
    ids=["no colours", "no effects", "no dashes"],
)
def test_what_matplotlib_cannot_draw_is_told_in_words(
    tmp_path: Path, text: str, words: str, kinds: tuple[Kind, ...]
) -> None:
    style = write(tmp_path, text)
    for kind in kinds:
        with pytest.raises(FigureError) as error:
            check_style(kind, style, tmp_path / "a.svg")
        first, why, hint = str(error.value).splitlines()
        assert first == f"Nothing can be drawn with {style}."
        assert words in why
        assert "one by one" in hint


@pytest.mark.parametrize("kind", get_args(Kind))
def test_a_trial_finds_a_style_without_room_and_writes_nothing(tmp_path: Path, kind: Kind) -> None:
    style = write(tmp_path, "figure.figsize: 0.5, 0.5\n")
    with pytest.raises(FigureError, match=r"^The style leaves no room"):
        check_style(kind, style, tmp_path / "a.png")
    for suffix in SUFFIXES:
        check_style(kind, write(tmp_path, "figure.figsize: 3, 2\n"), tmp_path / f"a{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [style.name]


def test_a_defect_of_a_figure_is_not_put_on_the_style(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qcompile.report.rewards.labelled", lambda *axes: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        figure()


def test_a_font_that_is_missing_is_noted_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    style = write(tmp_path, "font.family: No Such Letters\n")
    for name in ("a.svg", "b.svg"):
        figure(style).save(tmp_path / name)
    words = "Font family 'No Such Letters' not found: another font is used instead."
    assert [record.getMessage() for record in caplog.records] == [words]


def test_the_house_style_is_a_style_file_as_others_are() -> None:
    assert Style.of(HOUSE).settings == Style.of(None).settings
