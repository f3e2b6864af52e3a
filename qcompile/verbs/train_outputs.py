"""The files of a training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qcompile.errors import OptionError, QcompileError
from qcompile.output import check_writable, resolved
from qcompile.policy import load_policy, save_policy
from qcompile.policy.files import SUFFIXES, policy_file
from qcompile.verbs.files import check_distinct, check_new

if TYPE_CHECKING:
    from qcompile.policy import AnyPolicy
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.watch import Watch


@dataclass(frozen=True)
class TrainingOutputs:
    """What a training writes, and the checkpoint that it resumes from; None for what it does not.

    `out` is the policy; of mvqc, which makes none yet, it is its checkpoint. `out` and `checkpoint`
    are overwritten with `force` alone; but the checkpoint that is resumed is kept up to date, and a
    resumed training overwrites its own policy.
    """

    out: Path | None
    checkpoint: Path | None
    log: Path | None
    resume: Path | None
    tensorboard: Path | None
    force: bool = False

    def check(self, trainer: Trainer) -> None:
        """Nothing, if every file can be written and replaces no other.

        Raises:
            OptionError: a wrong suffix, a name that no policy can have, or files that are the same
                or lie in each other.
            OutputError: a file that is there already, or cannot be written.
            PolicyError: a policy that is too large for a file.
        """
        policy = trainer.policy()
        has_policy = policy is not None
        if self.out is not None:
            self._check_name(self.out, has_policy, trainer.settings.model)
            if policy is not None:
                policy_file(policy)
        allowed = [frozenset({"resume", "checkpoint"})]
        if not has_policy:
            allowed += [frozenset({"out", other}) for other in ("resume", "checkpoint")]
        names = ("out", "checkpoint", "log", "resume", "tensorboard")
        taken = check_distinct({name: getattr(self, name) for name in names}, allowed)
        for inner, option in taken.items():
            for outer in inner.parents:
                if outer in taken and taken[outer] != "tensorboard" and not outer.is_dir():
                    raise OptionError(f"{option}: {inner} lies in the file of {taken[outer]}.")
        resumable = "It can be resumed with --resume"
        for option, path, why in (
            ("checkpoint", self.checkpoint, resumable),
            ("out", self.out, ""),
        ):
            if path is not None and not self._continues(path, trainer):
                check_new(path, option, self.force, why)
        for path in (self.log, self.checkpoint, self.out):
            if path is not None:
                check_writable(path)

    def _continues(self, path: Path, trainer: Trainer) -> bool:
        """Whether a file is the checkpoint that is resumed, or was made by the same training."""
        if self.resume is None:
            return False
        if resolved(path) == resolved(self.resume):
            return True
        from qcompile.rl.checkpoint import identity
        from qcompile.rl.settings import restored

        try:
            if (own_policy := trainer.policy()) is None:
                made_by = identity(path)
            else:
                policy = load_policy(path)
                settings = restored(policy.metadata["settings"])
                seed = policy.metadata["seed"]
                made_by = (policy.environment, dict(policy.environment_kwargs), settings, seed)
                if not _same_circuits(policy.metadata, own_policy.metadata):
                    return False
        except (QcompileError, LookupError, TypeError, ValueError):  # a file of anything else
            return False
        own = (trainer.environment, trainer.arguments, trainer.settings, trainer.seed)
        return path == self.out and made_by == own

    def of_seed(self, seed: int) -> TrainingOutputs:
        """The files of one of several trainings: the seed is in their names, and none is `out`."""
        return TrainingOutputs(
            out=None,
            checkpoint=_numbered(self.checkpoint, seed),
            log=_numbered(self.log, seed),
            resume=None,
            tensorboard=None if self.tensorboard is None else self.tensorboard / f"seed-{seed}",
            force=self.force,
        )

    @staticmethod
    def _check_name(out: Path, has_policy: bool, model: str) -> None:
        if out.suffix not in SUFFIXES:
            raise OptionError(f"{out} must end with .pt or .json.")
        if not has_policy and out.suffix != ".pt":
            raise OptionError(
                f"{out} must end with .pt: model {model!r} is an entangling circuit, which this "
                "version does not play yet, so it is saved as a checkpoint."
            )
        if not out.stem.isprintable():
            raise OptionError(
                f"{str(out)!a} must have a name of printable characters: it names the policy."
            )

    def write(self, policy: AnyPolicy | None, watch: Watch) -> AnyPolicy | None:
        """Write the policy, or the checkpoint of a model that has none; the policy by its name."""
        if policy is not None:
            return self.named(policy)
        if self.out is not None:
            watch.save(self.out)
        return None

    def named(self, policy: AnyPolicy) -> AnyPolicy:
        """The policy by the name of its file, which is written; without a file as it is."""
        if self.out is None:
            return policy
        policy = replace(policy, name=self.out.stem)
        save_policy(policy, self.out)
        return policy


def _same_circuits(metadata: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two policies were trained with the same circuits of one's own, or with none.

    Their trained numbers are those of different updates.
    """
    one, two = (dict(values.get("circuits", {})) for values in (metadata, other))
    names = [sorted(circuits.pop("parameters", {})) for circuits in (one, two)]
    return one == two and names[0] == names[1]


def _numbered(path: Path | None, seed: int) -> Path | None:
    """log-3.csv of log.csv for seed 3."""
    return None if path is None else path.with_name(f"{path.stem}-{seed}{path.suffix}")
