"""The service's refusals."""

from __future__ import annotations

from typing import Any


class ApiError(Exception):
    """An answer with an HTTP status that is not a success, and IBM's body of an error.

    Where it has `retry_after_seconds`, they come as Retry-After.
    """

    def __init__(
        self,
        status: int,
        code: int | str,
        message: str,
        retry_after_seconds: float | None = None,
    ):
        super().__init__(message)
        self.status = status
        self.code = code
        self.retry_after_seconds = retry_after_seconds

    def body(self) -> dict[str, Any]:
        error = {"code": self.code, "message": str(self), "solution": "", "more_info": ""}
        return {"errors": [error], "trace": "stand-in"}
