"""Runs with two copies: an older one is restored, or both are resumed at once."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from chaos_trial import Trial, copied, plain


def restored(trial: Trial, rng: np.random.Generator, live_s: float) -> None:
    """An older copy of the run's folder is restored in mid-run, and the run resumed from it."""
    if not _killed(trial, rng.uniform(0, live_s)):
        return trial.finish()
    copied(trial, "older")
    _killed(trial, rng.uniform(0, live_s))
    _put_back(trial)
    return trial.finish()


def restored_at_the_end(trial: Trial, rng: np.random.Generator, live_s: float) -> None:
    """The run is finished, and then resumed from an older copy."""
    if _killed(trial, rng.uniform(0, live_s)):
        copied(trial, "older")
        trial.finish()
        _put_back(trial)
        trial.result = None
    trial.finish()


def restored_while_charges_are_pending(
    trial: Trial, rng: np.random.Generator, live_s: float
) -> None:
    """As `restored_at_the_end`, but no charge is reported until the run has ended."""
    trial.stand_in.settings.usage_lag_seconds = 3600.0
    restored_at_the_end(trial, rng, live_s)


def two_at_once(trial: Trial, rng: np.random.Generator, live_s: float) -> None:
    """The run is killed and copied to another folder, and both are resumed at the same time.

    They may pay for the same steps; the one that ends last reports everything.
    """
    if not _killed(trial, rng.uniform(0, live_s)):
        return trial.finish()
    trial.alone = False
    twin = replace(trial, runs=copied(trial, "elsewhere"), starts=100)
    for _ in range(20):
        both = [one for one in (trial, twin) if one.result is None]
        running = [one.start() for one in both]
        for one, process in zip(both, running, strict=True):
            one.check_process(process.wait())
        if trial.result is not None and twin.result is not None:
            break
    if twin.result != trial.result and plain(twin.result) != plain(trial.result):
        trial.wrong.append("the copy has a different result")
    last = max(trial.folder.glob("code*"), key=lambda path: path.stat().st_mtime)
    if int(last.name.removeprefix("code")) > 100:
        trial.runs = twin.runs
    return None


def _killed(trial: Trial, after_s: float) -> bool:
    """Start or resume the run and kill it after a while; return whether it is under way."""
    running = trial.start()
    running.wait_for_run()
    time.sleep(after_s)
    trial.kills += running.kill()
    trial.check_process(running.wait())
    return trial.result is None and trial.run is not None


def _put_back(trial: Trial) -> None:
    [older] = (trial.folder / "older").iterdir()
    folder = trial.folder / trial.runs / older.name
    shutil.rmtree(folder)
    shutil.copytree(older, folder)


TWO_AT_ONCE = "copies: two at once"
COPIES: dict[str, Callable[[Trial, np.random.Generator, float], None]] = {
    "copies: restored": restored,
    "copies: restored at the end": restored_at_the_end,
    "copies: restored, charges pending": restored_while_charges_are_pending,
    TWO_AT_ONCE: two_at_once,
}
