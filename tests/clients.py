"""A browser of Django's tests, as a racer or as a guest."""

from __future__ import annotations

from django.test import Client

from accounts.models import Racer

BACKEND = "django.contrib.auth.backends.ModelBackend"


def logged_in(racer: Racer | None) -> Client:
    """A client in which ``racer`` is logged in, without a password; None: nobody is."""
    client = Client()
    if racer is not None:
        client.force_login(racer, backend=BACKEND)
    return client
