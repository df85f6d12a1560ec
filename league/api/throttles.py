"""How often one racer may write. Reading is not limited."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rest_framework.permissions import SAFE_METHODS
from rest_framework.request import Request
from rest_framework.throttling import ScopedRateThrottle

if TYPE_CHECKING:  # views import this module
    from rest_framework.views import APIView


class WriteThrottle(ScopedRateThrottle):
    """Counts each racer's unsafe requests against the view's ``throttle_scope`` ("write" unless it says otherwise).

    Anonymous requests are not counted: the only ones that write anything are attempts to log in, which allauth
    limits together with those of the site's form.
    """

    def allow_request(self, request: Request, view: APIView) -> bool:
        if request.method in SAFE_METHODS or not request.user.is_authenticated:
            return True
        self.scope = getattr(view, "throttle_scope", "write")
        self.rate = self.get_rate()
        self.num_requests, self.duration = self.parse_rate(self.rate)
        return super(ScopedRateThrottle, self).allow_request(request, view)
