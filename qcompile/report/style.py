"""How figures look: fonts, sizes and colours, from a style file of matplotlib."""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from qcompile.errors import FigureError, QcompileError
from qcompile.output import checked_path
from qcompile.reading.files import ContentsError, read_file
from qcompile.reading.text import decode
from qcompile.report.fonts import fonts_noted_once
from qcompile.terminal import first_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

HOUSE = Path(__file__).with_name("qcompile.mplstyle")
_PACKAGE = HOUSE.parent.parent

_GAP_IN = 0.2
_MOST_BYTES = 1 << 20
_FOREIGN = re.compile(
    r"(animation|backend|docstring|interactive|keymap|pgf|timezone|tk|toolbar|webagg)(\..*|_.*)?"
    r"|date\.epoch|figure\.(max_open_warning|raise_window|hooks)|text\.(usetex|latex\..*)"
    r"|savefig\.(directory|format)|svg\.image_inline"
)
"""Settings of windows, programs and other files; none of how a figure looks."""
_LIMITS = {
    "savefig.dpi": (30, 1200),
    "figure.dpi": (30, 1200),
    "font.size": (1, 100),
    "savefig.pad_inches": (0, 5),
}
_SIZE_IN = (0.5, 40.0)


@dataclass(frozen=True)
class Style:
    """Settings of matplotlib: the house's, and over them those of a file.

    With `one_width`, because the file sets figure.figsize, every figure has the width that it says.
    """

    settings: Mapping[str, Any]
    file: Path | None = None
    one_width: bool = False

    @classmethod
    def of(cls, style: Style | str | PathLike[str] | None) -> Style:
        """The house's style, or the one of a .mplstyle file over it.

        Raises:
            FigureError: the file cannot be read, or holds what matplotlib does not take.
            OptionError: it is neither a style nor a file.
        """
        if isinstance(style, Style):
            return style
        if style is None:
            return cls(_house())
        file = checked_path(style, "style")
        own = _settings(file)
        return cls({**_house(), **own}, file, one_width="figure.figsize" in own)

    @property
    def colours(self) -> list[Any]:
        """Those of the cycle of colours, one at least."""
        found: list[Any] = self.settings["axes.prop_cycle"].by_key().get("color", [])
        return found or [self.settings.get("lines.color", "C0")]

    @property
    def column_in(self) -> float:
        """The width of a figure in one column, in inches."""
        return float(self.settings["figure.figsize"][0])

    @property
    def page_in(self) -> float:
        """The width of a figure across two columns, in inches."""
        return self.column_in if self.one_width else 2 * self.column_in + _GAP_IN

    @property
    def height_in(self) -> float:
        """The usual height of a row of panels, in inches."""
        return float(self.settings["figure.figsize"][1])

    def drawing(self, height_in: float, *, wide: bool = False) -> Drawing:
        """An empty figure of one column, or across two.

        To be called where the style is `applied`.
        """
        from matplotlib.figure import Figure as Drawing

        width_in = self.page_in if wide else self.column_in
        return Drawing(figsize=(width_in, height_in), layout="constrained")

    @contextmanager
    def applied(self) -> Iterator[None]:
        """What is drawn within looks like this, whatever else matplotlib was told.

        Raises:
            FigureError: nothing can be drawn with the settings of the file.
        """
        import matplotlib as mpl

        settings: Any = mpl.rcParams
        default = {
            key: value for key, value in mpl.rcParamsDefault.items() if not _FOREIGN.fullmatch(key)
        }
        with warnings.catch_warnings(), mpl.rc_context(), fonts_noted_once():
            warnings.simplefilter("ignore", mpl.MatplotlibDeprecationWarning)
            settings.update(default)
            settings.update({"text.usetex": False, **self.settings})
            try:
                yield
            except QcompileError:
                raise
            except Exception as error:
                if self.file is None or _PACKAGE in self.file.parents:
                    raise  # a defect of qcompile
                raise FigureError(
                    f"Nothing can be drawn with {self.file}.",
                    f"matplotlib fails: {type(error).__name__}: {first_line(str(error))}",
                    "Remove its settings one by one to find the one that matplotlib cannot use.",
                ) from error


AnyStyle: TypeAlias = Style | str | PathLike[str] | None
"""A style, its .mplstyle file, or None for the house's."""


@cache
def _house() -> Mapping[str, Any]:
    return _settings(HOUSE)


def _settings(path: Path) -> dict[str, Any]:
    """What a style file sets: values that matplotlib has checked, by their names."""
    import matplotlib as mpl

    if path.suffix != ".mplstyle":
        raise FigureError(f"{path} must end with .mplstyle.")
    try:
        text = decode(read_file(path, _MOST_BYTES))
    except ContentsError as error:
        raise FigureError(f"{path} is not a style file.", str(error)) from None
    except OSError as error:
        raise FigureError(f"Cannot read {path}.", f"{error.strerror or error}.") from None
    found: Any = mpl.RcParams()  # whose keys are typed one by one
    for number, line in enumerate(text.splitlines(), 1):
        if not (written := _without_comment(line)):
            continue
        name, colon, value = (part.strip() for part in written.partition(":"))
        try:
            if not colon:
                raise ValueError("it is not NAME: VALUE")
            if _FOREIGN.fullmatch(name):
                raise ValueError(f"{name} does not say how a figure looks: remove it")
            if name == "axes.prop_cycle":
                _check_cycle(value)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mpl.MatplotlibDeprecationWarning)
                found[name] = value.removeprefix('"').removesuffix('"')
            _check_value(name, found[name])
        except KeyError:
            raise FigureError(
                f"{path}, line {number}: matplotlib has no setting {name[:60]!r}."
            ) from None
        except Exception as error:  # matplotlib raises ValueError, TypeError, RuntimeError
            raise FigureError(f"{path}, line {number}: {_one_line(error)}.") from None
    return dict(found)


def _without_comment(line: str) -> str:
    """The line before the first # outside quotes, as matplotlib reads it."""
    found = re.match(r'(?:"[^"]*"|[^#"])*', line)
    assert found is not None
    return found[0].strip()


def _check_cycle(written: str) -> None:
    """Nothing, if a cycle is cycler(...) of plain values; earlier matplotlibs evaluate more."""
    try:
        tree = ast.parse(written, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"{written[:60]!r} is not a cycle such as cycler(color=['C0'])") from None
    parts = [tree]
    while parts:
        node = parts.pop()
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Mult):
            parts += [node.left, node.right]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id != "cycler":
                raise ValueError("a cycle is made with cycler(...) alone")
            values = [*node.args, *(word.value for word in node.keywords)]
            if not all(_is_plain(value) for value in values):
                raise ValueError("a cycle has plain values in lists")
        else:
            raise ValueError("a cycle is made with cycler(...) alone")


def _is_plain(node: ast.expr) -> bool:
    if isinstance(node, ast.List | ast.Tuple):
        return len(node.elts) <= 100 and all(map(_is_plain, node.elts))
    return isinstance(node, ast.Constant) and isinstance(node.value, str | int | float)


def _check_value(name: str, value: Any) -> None:
    """Raise ValueError where matplotlib takes a value that nothing can be drawn with."""
    if name == "figure.figsize" and not all(_SIZE_IN[0] <= side <= _SIZE_IN[1] for side in value):
        raise ValueError(f"figures are between {_SIZE_IN[0]} and {_SIZE_IN[1]:g} inches")
    if name in _LIMITS and not isinstance(value, str):
        least, most = _LIMITS[name]
        if not (math.isfinite(value) and least <= value <= most):
            raise ValueError(f"{name} is between {least} and {most}")


def _one_line(error: Exception) -> str:
    words = " ".join(str(error).split()).removeprefix("Key ").rstrip(".")
    return words if len(words) <= 200 else f"{words[:197]}..."
