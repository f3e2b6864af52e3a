"""Plans and live runs of the command line against the stand-in of IBM's service, by its ledger."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from live_ledger import charged_s, jobs_of
from standin import StandIn

MACHINES = {"fake_fez": "FakeFez", "fake_toronto": "FakeTorontoV2"}
LARGE, SMALL = MACHINES
"""Machines with 156 and 27 qubits."""
_ROUNDING_S = 1e-6


@dataclass
class Row:
    """A live run, its requirements, and those it fails."""

    part: str
    command: str
    qubits: int
    episodes: int = 0
    mean_reward: float | None = None
    mean_reward_completed: float | None = None
    cut_episodes: int = 0
    env_steps: int = 0
    jobs: int = 0
    executions: int = 0
    qpu_seconds: float = 0.0
    """The charge in the ledger."""
    planned_seconds: float | None = None
    planned_80: tuple[float, float] | None = None
    paper_seconds: float | None = None
    """The seconds of the paper's strategy: a job for each circuit and step, without calibration."""
    wall_seconds: float = 0.0
    wanted: str = ""
    wrong: list[str] = field(default_factory=list)

    def want(self, words: str, holds: bool) -> Self:
        """Record a requirement and whether it is met."""
        self.wanted = ", ".join(filter(None, (self.wanted, words)))
        if not holds:
            self.wrong.append(f"not {words}")
        return self

    def want_mean(self, least: float) -> Self:
        return self.want(f"mean >= {least:g}", (self.mean_reward or -1e9) >= least)

    def want_seconds(self, most: float) -> Self:
        return self.want(f"<= {most:g} s", self.qpu_seconds <= most)

    def want_planned(self) -> Self:
        """Require the same seed's cost to lie within a tenth of the plan."""
        planned = self.planned_seconds or 0.0
        near = abs(self.qpu_seconds - planned) <= 0.1 * planned
        return self.want(f"within 10 % of {planned:.0f} s", near)

    def values(self) -> dict[str, Any]:
        return asdict(self)


@dataclass
class Service:
    """The command line in `folder`, and a stand-in of IBM's service with two machines."""

    folder: Path
    stand_in: StandIn

    def call(self, *words: str) -> dict[str, Any]:
        """The JSON that a command prints.

        Raises:
            RuntimeError: it fails; the message is its output.
        """
        environment = os.environ | self.stand_in.environment()
        ended = subprocess.run(
            (sys.executable, "-m", "qcompile", *words, "--json"),
            cwd=self.folder,
            env=environment | {"USAGE_DATA_OPT_OUT": "True"},
            capture_output=True,
            text=True,
        )
        if not ended.stdout:
            raise RuntimeError(ended.stderr.strip().rpartition("Error: ")[2])
        values: dict[str, Any] = json.loads(ended.stdout)
        return values

    def plan(
        self, policy: str, backend: str, episodes: int, within: float, seed: int, *more: str
    ) -> dict[str, Any]:
        """The settings that `qcompile plan` recommends, or the cheapest that keep the reward.

        Raises:
            RuntimeError: no settings keep the reward.
        """
        words = ("--episodes", str(episodes), "--within", f"{within:g}", "--seed", str(seed))
        planned = self.call("plan", policy, "--backend", backend, *words, *more)
        if planned["recommended"] is not None:
            return dict(planned["recommended"])
        keep = [row for row in planned["frontier"] if row["share"] >= planned["keep"]]
        if not keep:
            raise RuntimeError(f"No settings keep the reward of {policy} on {backend}.")
        cheapest: dict[str, Any] = min(keep, key=lambda row: row["qpu_seconds"])
        options = {"--seed": seed} | {
            f"--{name.replace('_', '-')}": cheapest[name]
            for name in ("shots", "copies", "speculate", "calibration_shots", "max_steps")
            if cheapest[name] is not None
        }
        words = ("qcompile", "run", policy, "--backend", backend, "--episodes", str(episodes))
        words += tuple(str(word) for pair in options.items() for word in pair)
        return cheapest | {"command": shlex.join(words + ("--split",) * cheapest["split"])}

    def run(self, part: str, command: str, limit_s: float = 1e5) -> Row:
        """Run the command live, and read its cost from the ledger; a failure counts as wrong."""
        words = shlex.split(command)
        backend = words[words.index("--backend") + 1]
        row = Row(part, command, qubits=156 if backend == LARGE else 27)
        known = {path.name for path in (self.folder / "runs").glob("*")}
        live = ("--live", "--yes", "--max-qpu-seconds", f"{limit_s:g}")
        try:
            result = self.call(*words[1:], *live)
        except RuntimeError as error:
            row.wrong.append(str(error).replace("\n", " "))
            names = {path.name for path in (self.folder / "runs").glob("*")} - known
            row.qpu_seconds = sum(charged_s(jobs_of(self.stand_in, name)) for name in names)
            return row
        jobs = jobs_of(self.stand_in, result["run"])
        row.episodes, row.mean_reward = len(result["episodes"]), result["mean_reward"]
        row.mean_reward_completed = result["mean_reward_completed"]
        row.cut_episodes, row.env_steps = result["cut_episodes"], result["env_steps"]
        row.jobs, row.executions = len(jobs), sum(job.executions for job in jobs)
        row.qpu_seconds, row.wall_seconds = charged_s(jobs), result["wall_seconds"]
        a_circuit_s = 2 + 0.00035 * result["shots"]  # IBM's estimate of a job
        row.paper_seconds = result["decisions"] * result["circuits_per_step"] * a_circuit_s
        for name in ("qpu_seconds", "qpu_seconds_settled"):
            if abs(result[name] - row.qpu_seconds) > _ROUNDING_S:
                row.wrong.append(f"{name} is {result[name]:.6f}, charged {row.qpu_seconds:.6f}")
        if (result["jobs"], result["executions"]) != (row.jobs, row.executions):
            row.wrong.append(f"reports {result['jobs']} jobs, {result['executions']} executions")
        if row.cut_episodes > 0.02 * row.episodes:  # a plan's promise for its own episodes
            row.wrong.append(f"{row.cut_episodes} episodes are cut")
        return row

    def planned(
        self,
        part: str,
        policy: str,
        backend: str,
        episodes: int,
        within: float,
        seed: int,
        *more: str,
    ) -> Row:
        """Run a plan's command live, and compare it with the plan."""
        try:
            plan = self.plan(policy, backend, episodes, within, seed, *more)
        except RuntimeError as error:
            row = Row(part, f"plan {policy}", qubits=156 if backend == LARGE else 27)
            row.wrong.append(str(error).replace("\n", " "))
            return row
        row = self.run(part, plan["command"])
        row.planned_seconds = plan["qpu_seconds"]
        row.planned_80 = tuple(plan["qpu_seconds_80"])
        return row
