"""The limit of write requests per racer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from django.core.exceptions import ImproperlyConfigured
from rest_framework.permissions import SAFE_METHODS
from rest_framework.request import Request
from rest_framework.throttling import ScopedRateThrottle

if TYPE_CHECKING:  # views import this module
    from rest_framework.views import APIView


class WriteThrottle(ScopedRateThrottle):
    """Limits each racer's unsafe requests by the view's ``throttle_scope`` (default: "write").

    Guests are not counted: they only log in, which allauth limits. A view with a ``throttle_refused_scope`` counts
    refused requests against that scope instead (:meth:`count_as_refused`)."""

    _refused: WriteThrottle | None = None
    _spent: WriteThrottle | None = None  # the allowance of refused ones, when that is used up

    def allow_request(self, request: Request, view: APIView) -> bool:
        if request.method in SAFE_METHODS or not request.user.is_authenticated:
            return True
        self._asked = request
        scope = getattr(view, "throttle_refused_scope", None)
        if scope in self.THROTTLE_RATES:  # else they count as all others
            self._refused = WriteThrottle()
            if not self._refused._look(request, view, scope):
                self._spent = self._refused
                self._refused._tell(request)
                return False
        if not self._look(request, view, getattr(view, "throttle_scope", "write")):
            self._tell(request)
            return False
        self.throttle_success()
        self._tell(request)
        return True

    def wait(self) -> float | None:
        """Seconds until there is something left of the allowance that is used up."""
        return super().wait() if self._spent is None else self._spent.wait()

    def count_as_refused(self) -> None:
        """Take back what this request has used up, and count it in the wider allowance of refused ones."""
        if self._refused is None or not getattr(self, "history", None):
            return
        history = self.cache.get(self.key, [])
        if self.now in history:
            history.remove(self.now)
            self.cache.set(self.key, history, self.duration)
            self.history = history
            self._tell(self._asked)
        self._refused.throttle_success()
        self._refused = None

    def _look(self, request: Request, view: APIView, scope: str) -> bool:
        """Whether there is something left of this allowance; counts nothing."""
        self.scope = scope
        self.rate = self.get_rate()
        self.num_requests, self.duration = limit, window_s = self.parse_rate(self.rate)
        if limit is None or window_s is None:
            raise ImproperlyConfigured(f"there is no rate for {scope}")
        self._limit, self._window_s = limit, window_s
        self.key = self.get_cache_key(request, view)
        self.history = self.cache.get(self.key, [])
        self.now = self.timer()
        while self.history and self.history[-1] <= self.now - self._window_s:
            self.history.pop()
        return len(self.history) < self._limit

    def _tell(self, request: Request) -> None:
        """Store the answer's rate limit headers (IETF draft) with the request, for
        :mod:`config.middleware.http_caching`."""
        oldest = self.history[-1] if self.history else self.now
        request._request.rate_limit = {  # type: ignore[attr-defined]
            "RateLimit-Limit": str(self._limit),
            "RateLimit-Remaining": str(max(0, self._limit - len(self.history))),
            "RateLimit-Reset": str(max(0, math.ceil(oldest + self._window_s - self.now))),
        }
