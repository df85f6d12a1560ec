"""Who asks."""

from __future__ import annotations

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest
from rest_framework.request import Request

from .models import Racer


def racer_of(request: HttpRequest | Request) -> Racer:
    """The racer of a request that only somebody logged in may make. Raises PermissionDenied for nobody."""
    user = request.user
    if not isinstance(user, Racer):
        raise PermissionDenied
    return user
