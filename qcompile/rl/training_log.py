"""Reports of a running training: averages, updates, a CSV file and scalars."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from qcompile.caller import option
from qcompile.errors import MissingExtraError, OutputError
from qcompile.output import check_writable
from qcompile.rl.order import AVERAGED, StartOrder

if TYPE_CHECKING:
    from qcompile.rl.rollout import FinishedEpisode

Callback = Callable[[Mapping[str, float], int], object]
"""Called with scalars by name and the environment steps taken so far; returning False ends the
training after the next update."""

_FLUSH_SECONDS = 5


@dataclass(frozen=True)
class Update:
    """Losses and diagnostics of a PPO update, at its last minibatch.

    `divergence` estimates the Kullback-Leibler divergence of the old from the new policy, in nats;
    `clipped` is the fraction of clipped ratios.
    """

    steps: int
    episodes: int
    actor_loss: float
    critic_loss: float
    entropy: float
    divergence: float
    clipped: float

    @property
    def scalars(self) -> dict[str, float]:
        """The values by the names of the scalars."""
        names = ("actor_loss", "critic_loss", "entropy", "divergence", "clipped")
        return {f"update/{name}": getattr(self, name) for name in names}


class Averages:
    """Average rewards: `last`, over the last 20 episodes (fewer before the 20th), and `best`, the
    highest over 20 in a row (None before the 20th).

    Episodes count in the order they began in `environments` environments, each once all earlier
    ones have ended.
    """

    def __init__(self, environments: int = 1, episodes: Iterable[FinishedEpisode] = ()):
        self._order = StartOrder(environments)
        self._rewards: deque[float] = deque(maxlen=AVERAGED)
        self.last: float | None = None
        self.best: float | None = None
        for episode in episodes:
            self.add(episode)

    def add(self, episode: FinishedEpisode) -> None:
        """Count one more episode."""
        for reward in self._order.add(episode.decisions, episode.reward):
            self._rewards.append(reward)
            self.last = sum(self._rewards) / len(self._rewards)
            if len(self._rewards) == AVERAGED:
                self.best = self.last if self.best is None else max(self.best, self.last)


class EpisodeLog:
    """A CSV file with a row for each finished episode, written immediately.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: Path, episodes: Iterable[FinishedEpisode] = ()):
        self._path, self._count = path, 0
        with self._explained():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb", buffering=0)
        try:
            self._write("episode,steps,reward")
            self.add_missing(episodes)
        except BaseException:
            self._file.close()
            raise

    def add_missing(self, episodes: Iterable[FinishedEpisode]) -> None:
        """Write the episodes that have no row yet."""
        for episode in episodes:
            if episode.episode > self._count:
                self._write(f"{episode.episode},{episode.steps},{episode.reward}")
                self._count = episode.episode

    def _write(self, row: str) -> None:
        with self._explained():
            self._file.write(f"{row}\n".encode())

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"Cannot write {self._path}.",
                f"{error.strerror or error}.",
                "Choose another path.",
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


class TensorBoard:
    """A callback that writes scalars for TensorBoard to `folder`, by environment step.

    `steps` is the step at which a training resumes: TensorBoard drops later entries of an earlier
    run.

    Raises:
        MissingExtraError: tensorboard is not installed.
        OutputError: the folder cannot be written.
    """

    def __init__(self, folder: Path, steps: int = 0):
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise MissingExtraError(option("tensorboard"), "tensorboard") from error
        check_writable(folder / "events")
        purge = steps + 1 if steps else None
        make: Any = SummaryWriter
        self._writer = make(str(folder), purge_step=purge, flush_secs=_FLUSH_SECONDS)

    def __call__(self, scalars: Mapping[str, float], steps: int) -> None:
        for name, value in scalars.items():
            self._writer.add_scalar(name, value, steps)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()
