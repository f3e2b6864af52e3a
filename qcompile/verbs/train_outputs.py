"""The files of a training."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from qcompile.errors import OptionError
from qcompile.output import check_writable
from qcompile.policy import save_policy
from qcompile.policy.files import SUFFIXES, policy_file
from qcompile.verbs.files import check_distinct

if TYPE_CHECKING:
    from qcompile.policy import AnyPolicy
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.watch import Watch


@dataclass(frozen=True)
class TrainingOutputs:
    """What a training writes, and the checkpoint that it resumes from; None for what it does not.

    `out` is the policy; of mvqc, which makes none yet, it is its checkpoint.
    """

    out: Path | None
    checkpoint: Path | None
    log: Path | None
    resume: Path | None
    tensorboard: Path | None

    def check(self, trainer: Trainer) -> None:
        """Nothing, if every file can be written and replaces no other.

        Raises:
            OptionError: a wrong suffix, a name that no policy can have, or files that are the same
                or lie in each other.
            OutputError: a file that cannot be written.
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
        taken = check_distinct(vars(self), allowed)
        for inner, option in taken.items():
            for outer in inner.parents:
                if outer in taken and taken[outer] != "tensorboard" and not outer.is_dir():
                    raise OptionError(f"{option}: {inner} lies in the file of {taken[outer]}.")
        for path in (self.log, self.checkpoint, self.out):
            if path is not None:
                check_writable(path)

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
        if self.out is None:
            return policy
        if policy is None:
            watch.save(self.out)
            return None
        named = replace(policy, name=self.out.stem)
        save_policy(named, self.out)
        return named
