"""The result of `run`: scores, figure, table, page and film."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qcompile.caller import option
from qcompile.errors import QcompileError
from qcompile.page.circuits import Compiled
from qcompile.page.document import Document
from qcompile.page.run import run_document
from qcompile.report.clip import Clip
from qcompile.report.figure import Figure
from qcompile.report.rewards import draw_rewards
from qcompile.report.style import AnyStyle
from qcompile.report.summary import caveats, interruption
from qcompile.report.table import Table
from qcompile.report.tables import run_table
from qcompile.verbs.reports import Reported


class RunResult(Reported):
    """The result of a run. After an interruption it has only the shortest episodes.

    `film` shows the first episode, if it was filmed.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        episodes: int,
        compiled: Compiled | None = None,
        film: Clip | None = None,
    ):
        super().__init__(values)
        self._requested, self._compiled, self.film = episodes, compiled, film

    @property
    def episodes(self) -> list[dict[str, Any]]:
        """Seed, reward and length of each episode."""
        episodes: list[dict[str, Any]] = self.to_dict()["episodes"]
        return episodes

    @property
    def rewards(self) -> list[float]:
        return [episode["reward"] for episode in self.episodes]

    @property
    def mean_reward(self) -> float | None:
        """None if no episode was finished, or if a run with `speculate` was interrupted."""
        mean: float | None = self.to_dict()["mean_reward"]
        return mean

    @property
    def mean_reward_completed(self) -> float | None:
        """The mean with cut episodes completed on the noise model; None if none was cut."""
        mean: float | None = self.to_dict()["mean_reward_completed"]
        return mean

    @property
    def ci95(self) -> list[float] | None:
        """The 95 % interval of the mean; None if it cannot be estimated."""
        interval: list[float] | None = self.to_dict()["ci95"]
        return interval

    def plot(self, style: AnyStyle = None) -> Figure:
        """The reward of each episode, their mean and its interval.

        Raises:
            FigureError: the style cannot be read.
        """
        return draw_rewards(self.to_dict(), style)

    def table(self) -> Table:
        """A row with the settings, the mean reward and its interval."""
        return run_table(self.to_dict(), self._requested, self.warnings)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know before the mean reward."""
        interruption = " ".join(self._interruption)
        return [*filter(None, [interruption]), *caveats(self.to_dict())]

    def document(self, command: str) -> Document:
        return run_document(
            self.to_dict(),
            self.plot,
            self._compiled,
            self.film,
            warnings=self.warnings,
            command=command,
        )

    @property
    def _interruption(self) -> list[str]:
        return interruption(self.to_dict(), self._requested)

    def check_complete(self) -> None:
        """Check that all episodes were played.

        Raises:
            QcompileError: Ctrl-C ended the run before.
        """
        if words := self._interruption:
            raise QcompileError(*words, f"For a shorter run, use fewer {option('episodes')}.")
