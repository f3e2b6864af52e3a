"""The files of a training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qcompile.caller import option
from qcompile.clashes import Named, check_clashes
from qcompile.errors import OptionError, QcompileError
from qcompile.output import check_writable, resolved
from qcompile.policy import load_policy, save_policy
from qcompile.policy.files import SUFFIXES, policy_file
from qcompile.verbs.files import check_new

if TYPE_CHECKING:
    from qcompile.policy import AnyPolicy
    from qcompile.rl.ppo import Trainer


@dataclass(frozen=True)
class TrainingOutputs:
    """The files that a training writes, and the checkpoint that it resumes from, if any.

    `out` is the policy. `out` and `checkpoint` are overwritten only with `force`. A resumed
    training also updates its own checkpoint and policy. `reads` are other files that the training
    reads.
    """

    out: Path | None
    checkpoint: Path | None
    log: Path | None
    resume: Path | None
    tensorboard: Path | None
    force: bool = False
    reads: Named = field(default_factory=dict)

    def check(self, trainer: Trainer) -> None:
        """Check that every file can be written and replaces no other.

        Raises:
            OptionError: a suffix is wrong, a name cannot be that of a policy, or files are the same
                or inside each other.
            OutputError: a file already exists, or cannot be written.
            PolicyError: the policy is too large for a file.
        """
        if self.out is not None:
            self._check_name(self.out)
            policy_file(trainer.policy())
        self._check_clashes()
        resumable = f"It can be resumed with {option('resume')}"
        for name, path, why in (
            ("checkpoint", self.checkpoint, resumable),
            ("out", self.out, ""),
        ):
            if path is not None and not self._is_of(trainer, path):
                check_new(path, name, self.force, why)
        for path in (self.log, self.checkpoint, self.out):
            if path is not None:
                check_writable(path)

    def _check_clashes(self) -> None:
        """Check the names: only a trained policy, which `force` protects, may be overwritten."""
        same = [("resume", "checkpoint"), ("init", "out"), ("circuits", "out")]
        names = ("out", "checkpoint", "log", "tensorboard")
        check_clashes(
            {option("resume"): self.resume, **self.reads},
            {option(name): getattr(self, name) for name in names},
            folders=[option("tensorboard")],
            allowed=[frozenset({option(one), option(other)}) for one, other in same],
        )

    def _is_of(self, trainer: Trainer, path: Path) -> bool:
        """Whether a file is the checkpoint to resume, or was written by the same training."""
        if self.resume is None:
            return False
        if resolved(path) == resolved(self.resume):
            return True
        from qcompile.rl.settings import restored

        try:
            policy = load_policy(path)
            settings = restored(policy.metadata["settings"])
            seed = policy.metadata["seed"]
        except (QcompileError, LookupError, TypeError, ValueError):  # another kind of file
            return False
        if not _same_circuits(policy.metadata, trainer.policy().metadata):
            return False
        writer = (policy.environment, dict(policy.environment_kwargs), settings, seed)
        training = (trainer.environment, trainer.arguments, trainer.settings, trainer.seed)
        return path == self.out and writer == training

    def of_seed(self, seed: int) -> TrainingOutputs:
        """The files of one of several trainings, with the seed in their names and without `out`."""
        return TrainingOutputs(
            out=None,
            checkpoint=_numbered(self.checkpoint, seed),
            log=_numbered(self.log, seed),
            resume=None,
            tensorboard=None if self.tensorboard is None else self.tensorboard / f"seed-{seed}",
            force=self.force,
            reads=self.reads,
        )

    @staticmethod
    def _check_name(out: Path) -> None:
        if out.suffix not in SUFFIXES:
            raise OptionError(f"{out} must end with .pt or .json.")
        if not out.stem.isprintable():
            raise OptionError(
                f"{str(out)!a} must have printable characters only: the policy is named after it."
            )

    def named(self, policy: AnyPolicy) -> AnyPolicy:
        """Name the policy after its file and write it; without a file, return it as it is."""
        if self.out is None:
            return policy
        policy = replace(policy, name=self.out.stem)
        save_policy(policy, self.out)
        return policy


def _same_circuits(metadata: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two policies were trained with the same custom circuits, or both without.

    Their parameters may come from different updates.
    """
    one, two = (dict(values.get("circuits", {})) for values in (metadata, other))
    names = [sorted(circuits.pop("parameters", {})) for circuits in (one, two)]
    return one == two and names[0] == names[1]


def _numbered(path: Path | None, seed: int) -> Path | None:
    """log-3.csv for log.csv and seed 3."""
    return None if path is None else path.with_name(f"{path.stem}-{seed}{path.suffix}")
