"""The map of a device: what it shows, looked up among what matplotlib was given."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_hex
from matplotlib.text import Text

from qcompile.device import load_device
from qcompile.errors import FigureError
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable, compile
from qcompile.report.device_map import draw_map
from qcompile.report.positions import positions_of
from qcompile.report.style import Style
from qcompile.report.usage import Usage

BLUE = to_hex(Style.of(None).colours[0])


def placed(name: str, qubits: list[int], gates: str) -> Executable:
    """A circuit on these qubits of a device, the last of them for routing alone."""
    device, width = load_device(name), len(qubits)
    source = Program((Circuit((), width - 1),))
    native = Program((Circuit.parse(gates, width),))
    return Executable(source, native, device, 2, np.array(qubits), np.array([0]))


TWO = placed("fake_lima", [3, 4, 1], "cx@0,1 cx@1,0 sx@0 cx@2,0")


def axes_of(figure: Any) -> Any:
    return figure._drawing.axes[0]


def segments(axes: Any, is_blue: bool) -> set[tuple[float, ...]]:
    lines = [each for each in axes.collections if isinstance(each, LineCollection)]
    chosen = [each for each in lines if (to_hex(each.get_colors()[0]) == BLUE) is is_blue]
    return {tuple(np.ravel(ends).round(6)) for each in chosen for ends in each.get_segments()}


def test_a_circuit_uses_its_qubits_and_couplings() -> None:
    usage = Usage.of(TWO)
    assert usage.bits == {3: (0,), 4: (1,), 1: ()}
    assert usage.gates == {("cx", 3, 4): 1, ("cx", 4, 3): 1, ("cx", 1, 3): 1}
    assert usage.pairs == [(1, 3), (3, 4)]
    assert (usage.measured, usage.passed) == ([3, 4], [1])


def test_a_qubit_may_have_several_bits() -> None:
    """Of rounds that follow each other."""
    native = Program.of([Circuit.parse("sx")] * 3)
    both = Executable(
        native, native, load_device("fake_lima"), 2, np.array([2, 0, 2]), np.array([0, 0, 1])
    )
    assert Usage.of(both).bits == {2: (0, 2), 0: (1,)}


def test_couplings_in_use_have_a_broad_line_below() -> None:
    axes = axes_of(draw_map(TWO.device, Usage.of(TWO)))
    places = positions_of(TWO.device)

    def ends(*pairs: tuple[int, int]) -> set[tuple[float, ...]]:
        return {tuple(np.ravel(places[[*pair]]).round(6)) for pair in pairs}

    blue, others = (segments(axes, is_blue) for is_blue in (True, False))
    assert blue == ends((3, 4), (1, 3))
    assert others == ends((0, 1), (1, 2), (1, 3), (3, 4))


def test_qubits_in_use_have_a_broad_ring_and_bold_numbers() -> None:
    axes = axes_of(draw_map(TWO.device, Usage.of(TWO)))
    circles = [each for each in axes.collections if isinstance(each, PathCollection)]
    of_colour = {to_hex(each.get_facecolor()[0]): len(each.get_offsets()) for each in circles}
    assert of_colour == {BLUE: 2, to_hex(Style.of(None).colours[-2]): 1, "#ffffff": 5}
    bold = {text.get_text() for text in axes.texts if text.get_fontweight() == "bold"}
    assert bold == {"1", "3", "4"}
    assert {text.get_text() for text in axes.texts} == set("01234")


def test_colours_follow_the_errors() -> None:
    """The least error has the first colour of the scale, the greatest the last."""
    device = load_device("fake_lima")
    axes = axes_of(draw_map(device))
    (rings,) = (each for each in axes.collections if isinstance(each, PathCollection))
    errors = [(qubit.p10 + qubit.p01) / 2 for qubit in device.qubits]
    colours = [to_hex(colour) for colour in rings.get_edgecolor()]
    assert colours[int(np.argmin(errors))] == "#b4c0cc"
    assert colours[int(np.argmax(errors))] == "#d45d00"


def words(figure: Any) -> str:
    return " | ".join(text.get_text() for text in figure._drawing.findobj(Text))


def test_scales_and_legend_say_what_is_shown() -> None:
    said = words(draw_map(TWO.device, Usage.of(TWO), "a title"))
    for expected in ("a title", "readout error, %", "cx error, %", "in use", "for routing alone"):
        assert expected in said
    assert "in use" not in words(draw_map(TWO.device))


def test_a_large_map_is_cut_to_what_is_used_where_it_does_not_fit() -> None:
    """The corner of fez, in a column; across the page it is whole."""
    corner = placed("fake_fez", [0, 1, 2], "cz@0,1 cz@1,2")
    usage = Usage.of(corner)
    whole = axes_of(draw_map(corner.device, usage))
    cut = axes_of(draw_map(corner.device, usage, narrow=True))
    assert len(whole.texts) == 156
    assert {"0", "1", "2", "4", "20"} <= {text.get_text() for text in cut.texts}
    assert len(cut.texts) < 12
    spread = placed("fake_fez", [0, 15, 155], "")
    small = axes_of(draw_map(spread.device, Usage.of(spread), narrow=True))
    numbers = {text.get_text() for text in small.texts}
    assert numbers == {"0", "15", "155"}, "whole, without room for the other numbers"


def test_its_width_is_that_of_a_column_or_a_page() -> None:
    for name, wide in (("fake_lima", False), ("fake_toronto", True), ("fake_fez", True)):
        figure = draw_map(load_device(name))
        width_in = figure._drawing.get_size_inches()[0]
        assert width_in == (Style.of(None).page_in if wide else Style.of(None).column_in)
        narrow = draw_map(load_device(name), narrow=True)._drawing.get_size_inches()[0]
        assert narrow == Style.of(None).column_in


def test_an_executable_draws_its_own() -> None:
    assert TWO.plot_map().svg() == draw_map(TWO.device, Usage.of(TWO), "fake_lima").svg()
    narrow = compile(Program.of([Circuit.parse("sx")]), load_device("fake_lima"))
    assert "in use" in words(narrow.plot_map())


@pytest.mark.parametrize("name", ["ibm_lima", "ideal"])
def test_there_is_no_map_without_couplings(name: str) -> None:
    found = rf"^There is no map of {name}: it lists no couplings\.\n  Use a device that does"
    with pytest.raises(FigureError, match=found):
        draw_map(load_device(name))


def test_a_map_is_the_same_file_again() -> None:
    first, second = (draw_map(TWO.device, Usage.of(TWO)).svg() for _ in range(2))
    assert first == second
    assert not re.search(r'id="(figure|axes|patch|text|line2d)_\d', first)


def test_qubits_without_errors_have_a_map() -> None:
    lima = load_device("fake_lima")
    perfect = tuple(qubit.model_copy(update={"p10": 0.0, "p01": 0.0}) for qubit in lima.qubits)
    couplings = tuple(each.model_copy(update={"error": 0.01}) for each in lima.couplings)
    drawn = draw_map(lima.model_copy(update={"qubits": perfect, "couplings": couplings}))
    assert drawn.png
