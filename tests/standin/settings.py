"""How the stand-in behaves when nothing goes wrong."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Settings:
    """How the service behaves; every field may be changed while it runs."""

    seed: int = 0
    queue_seconds: float = 0.0
    run_seconds: float = 0.01
    usage_factor: float = 1.0
    """The usage of a job over IBM's estimate of it."""
    usage_limit_seconds: float = 600.0
    """What the plan has; jobs accepted once it is used up stay in the queue."""
    usage_lag_seconds: float = 0.0
    """How long after the end of a job its usage is pending."""
    token_seconds: float = 3600.0
    batch_seconds: float = 28800.0
    """The longest life of a batch."""
    jobs_per_minute: float = 0.0
    """More are answered with 429 and Retry-After; 0 takes any number."""
    minute_seconds: float = 60.0
    """How long such a minute lasts."""
