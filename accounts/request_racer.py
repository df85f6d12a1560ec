"""The racer of a request."""

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest
from rest_framework.request import Request

from .models import Racer


def racer_of(request: HttpRequest | Request) -> Racer:
    """The logged-in racer of a request. Raises PermissionDenied for a guest."""
    user = request.user
    if not isinstance(user, Racer):
        raise PermissionDenied
    return user
