"""The cast: Alice owns and organises, Bob is in, Charlie is a stranger, Sam is an admin; None is not logged in."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.core.cache import cache
from django.utils import timezone
from rest_framework.test import APIClient
from rest_framework.throttling import ScopedRateThrottle

from accounts.models import Racer
from accounts.tokens.services import create_token, note_use
from tests.api.fuzzed import Fuzzed, make_fuzzed
from tests.kept import Kept


@pytest.fixture(autouse=True)
def counted_from_nothing(wakes):
    """Limits are counted anew in every test; no broker is called."""
    cache.clear()


@pytest.fixture
def sam(db) -> Racer:
    return Racer.objects.create_superuser("sam", "sam@example.org", "correct horse battery")


@pytest.fixture
def as_racer() -> Callable[[Racer | None], APIClient]:
    """A client with a real token of the racer."""

    def make(racer: Racer | None) -> APIClient:
        client = APIClient()
        if racer is not None:
            token, text = create_token(racer=racer, now=timezone.now())
            note_use(grant=token.grant, now=timezone.now())
            client.credentials(HTTP_AUTHORIZATION=f"Token {text}")
        return client

    return make


@pytest.fixture
def cast(alice, bob, charlie, sam, as_racer) -> dict[str, APIClient]:
    """A client for every role."""
    people = {"owner": alice, "member": bob, "stranger": charlie, "admin": sam, "anonymous": None}
    return {role: as_racer(racer) for role, racer in people.items()}


@pytest.fixture(scope="session")
def kept_fuzzed(request, keep: Callable) -> Kept:
    return keep(request, make_fuzzed, fresh_s=20.0)  # as of the pages' world


@pytest.fixture
def fuzzed(kept_fuzzed: Kept, db: None, video_wakes, trainings_taken_on, monkeypatch) -> Fuzzed:
    rates = dict.fromkeys(("upload", "write", "timing"), "1000000/hour")
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", rates)
    return kept_fuzzed.copy()
