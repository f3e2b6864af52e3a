"""What IBM has under the tag of a job is not taken for it where it measures something else."""

from __future__ import annotations

import shutil

import pytest
from standin import StandIn

from qcompile.errors import ReplayError
from qcompile.live import GuardedSampler

from .sampled import bits, flipped


def test_a_program_that_was_changed_does_not_take_the_job_of_the_old_one(
    service: StandIn,
) -> None:
    """Its journal was restored from a copy that is older than the job."""
    with GuardedSampler("fake_lima"):
        pass
    shutil.copytree("runs/mine", "older")
    with GuardedSampler("fake_lima") as sampler:
        found = bits(sampler.run([flipped(0)], shots=50).result())
    shutil.rmtree("runs/mine")
    shutil.copytree("older", "runs/mine")
    with (
        GuardedSampler("fake_lima") as sampler,
        pytest.raises(ReplayError, match=r"in the place of job 0 .* measures something else"),
    ):
        sampler.run([flipped(3)], shots=50)
    with GuardedSampler("fake_lima") as sampler:
        assert bits(sampler.run([flipped(0)], shots=50).result()) == found
    [job] = service.ledger().jobs  # which is paid once
    assert job.status == "Completed"
