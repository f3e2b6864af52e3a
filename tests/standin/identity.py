"""The key of the account and the tokens that it is exchanged for."""

from __future__ import annotations

import threading
import time
import uuid
from typing import Any

import jwt

from .errors import ApiError
from .faults import Faults
from .settings import Settings

API_KEY = "standin-secret-token-0123456789abcdef"
"""A key that is easy to find where it should not be."""
CRN = (
    "crn:v1:bluemix:public:quantum-computing:us-east:"
    "a/0123456789abcdef0123456789abcdef:01234567-89ab-cdef-0123-456789abcdef::"
)

_SIGNING_KEY = "the stand-in signs its tokens with this and never checks the signature"


class Identity:
    """Issues tokens for the key, and knows which of them are still valid."""

    def __init__(self, faults: Faults, settings: Settings):
        self._faults = faults
        self._settings = settings
        self._given: dict[str, tuple[float, int]] = {}
        self._lock = threading.Lock()

    def token(self, key: str | None) -> dict[str, Any]:
        """A new token, as the answer of POST /identity/token.

        Raises:
            ApiError: 400, the key is not the account's or is refused.
        """
        if key != API_KEY or self._faults.key_refused:
            if key == API_KEY:
                self._faults.record("key_refused")
            raise ApiError(400, "BXNIM0415E", "Provided API key could not be found.")
        now = time.time()
        claims = {
            "iat": int(now),
            "exp": int(now + self._settings.token_seconds),
            "jti": uuid.uuid4().hex,
        }
        token = jwt.encode(claims, _SIGNING_KEY, algorithm="HS256")
        with self._lock:
            self._given[token] = (now + self._settings.token_seconds, self._faults.expired)
        return {
            "access_token": token,
            "refresh_token": "not_supported",
            "token_type": "Bearer",
            "expires_in": int(self._settings.token_seconds),
            "expiration": claims["exp"],
            "scope": "ibm openid",
        }

    def secrets(self) -> list[str]:
        """The key, every token issued so far, and the part of a token that names its owner."""
        with self._lock:
            tokens = list(self._given)
        return [API_KEY, *(part for token in tokens for part in token.split(".")[1:])]

    def check(self, authorization: str, crn: str) -> None:
        """Let a request with these headers pass.

        Raises:
            ApiError: 401, the token or key is not taken; 403, the instance is another.
        """
        scheme, _, secret = authorization.partition(" ")
        if scheme == "apikey":
            good = secret == API_KEY and not self._faults.key_refused
        else:
            good = self._is_good(secret)
        if not good:
            raise ApiError(401, 1200, "The token is not valid or has expired.")
        if crn != CRN:
            raise ApiError(403, 1201, "There is no access to this instance.")

    def _is_good(self, token: str) -> bool:
        with self._lock:
            expires, generation = self._given.get(token, (0.0, -1))
        if self._faults.key_refused:
            self._faults.record("key_refused")
            return False
        if generation >= 0 and generation != self._faults.expired:
            self._faults.record("token_expired")
            return False
        return time.time() < expires
