"""IBM's answers about jobs, validated before they are used."""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeVar

from pydantic import (
    AliasChoices,
    BaseModel,
    ConfigDict,
    Field,
    StrictFloat,
    StrictInt,
    ValidationError,
    WrapValidator,
)

from qcompile.errors import LiveError
from qcompile.terminal import one_line

_RAN_TOO_LONG = 1305
"""IBM's code for a job that it stopped at its `max_execution_time`."""
_MAX_OF_CAP = 10
"""A charge above this multiple of the job's cap is ignored as impossible."""

T = TypeVar("T", bound=BaseModel)


class UnreadableAnswerError(LiveError):
    """The service's answer does not have the shape that its interface documents."""

    def __init__(self, about: str):
        super().__init__(
            f"IBM's service gave an unreadable answer about {about}.",
            "Nothing is lost: resume later. If it persists, install the client version in "
            "constraints.txt.",
        )


def _or_none(value: Any, handler: Any) -> Any:
    try:
        return handler(value)
    except ValidationError:
        return None


_Lenient = WrapValidator(_or_none)
"""A value of the wrong type counts as missing."""


class _State(BaseModel):
    model_config = ConfigDict(frozen=True)

    status: str = ""
    reason: Annotated[str | None, _Lenient] = None
    reason_code: Annotated[int | None, _Lenient] = Field(
        default=None, validation_alias=AliasChoices("reason_code", "reasonCode")
    )


class RemoteJob(BaseModel):
    """A job as IBM reports it.

    `created` is IBM's timestamp as text and `cap_s` the number of seconds after which IBM stops the
    job; both are None where IBM omits them.
    """

    model_config = ConfigDict(frozen=True)

    id: str = Field(min_length=1, max_length=200)
    tags: Annotated[tuple[str, ...] | None, _Lenient] = None
    created: Annotated[str | None, _Lenient] = None
    cap_s: Annotated[Annotated[float, Field(gt=0, lt=1e9)] | None, _Lenient] = Field(
        default=None, validation_alias="cost"
    )
    state: _State = _State()

    @property
    def status(self) -> str:
        """IBM's status in capitals: QUEUED, RUNNING, COMPLETED, FAILED, CANCELLED or another."""
        return self.state.status.upper()

    @property
    def is_done(self) -> bool:
        return self.status == "COMPLETED"

    @property
    def is_cancelled(self) -> bool:
        return self.status.startswith("CANCELLED") and not self.was_cut_off

    @property
    def was_cut_off(self) -> bool:
        """Whether IBM stopped the job at its cap."""
        too_long = self.state.reason_code == _RAN_TOO_LONG or "TOO LONG" in self.status
        return too_long and not self.is_done and self.has_ended

    @property
    def has_ended(self) -> bool:
        return self.status.startswith(("COMPLETED", "FAILED", "CANCELLED"))

    @property
    def reason(self) -> str:
        """Why the job ended without counts."""
        words = one_line(self.state.reason or "IBM gives no reason.")
        code = self.state.reason_code
        return words if code is None else f"{words} (code {code})"


class Listing(BaseModel):
    """A page of jobs, and the total number over all pages."""

    jobs: list[RemoteJob]
    count: int = Field(ge=0)


class _Usage(BaseModel):
    status: str = "pending"
    qpu_charge_time_seconds: Annotated[StrictInt | StrictFloat | None, _Lenient] = None


class Metrics(BaseModel):
    """IBM's usage figures for a job."""

    usage: _Usage | None = None

    def charged_s(self, cap_s: float) -> float | None:
        """The charge for a job capped at `cap_s`, in seconds.

        None until IBM calls it complete, and for impossible values: negative, not finite, or more
        than ten times the cap.
        """
        if self.usage is None or self.usage.status.lower() != "complete":
            return None
        seconds = self.usage.qpu_charge_time_seconds
        if seconds is None or not 0 <= seconds <= _MAX_OF_CAP * max(cap_s, 1):
            return None
        return float(seconds) if math.isfinite(seconds) else None


def read(model: type[T], answer: Any, about: str) -> T:
    """The answer parsed as `model`.

    Raises:
        UnreadableAnswerError: the answer has a different shape.
    """
    try:
        return model.model_validate(answer)
    except ValidationError as error:
        raise UnreadableAnswerError(about) from error
