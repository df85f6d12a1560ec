"""The cast of the API's tests: Alice owns things, Bob takes part, Mallory is a stranger, Sam is an admin."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.core.cache import cache
from knox.models import AuthToken
from rest_framework.test import APIClient

from league.models import Racer


@pytest.fixture(autouse=True)
def quick_and_separate(settings):
    """Limits are counted in memory, from nothing in every test."""
    settings.CACHES = {"default": {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}}
    settings.PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]  # quick
    cache.clear()


@pytest.fixture
def racer(db) -> Callable[..., Racer]:
    def make(alias: str, **fields) -> Racer:
        return Racer.objects.create_user(alias, f"{alias.lower()}@example.org", "a long password 7", **fields)

    return make


@pytest.fixture
def alice(racer) -> Racer:
    return racer("Alice")


@pytest.fixture
def bob(racer) -> Racer:
    return racer("Bob")


@pytest.fixture
def mallory(racer) -> Racer:
    return racer("Mallory")


@pytest.fixture
def sam(racer) -> Racer:
    return racer("Sam", is_staff=True, is_superuser=True)


@pytest.fixture
def as_racer() -> Callable[[Racer | None], APIClient]:
    """A client with a real token of the racer; None is somebody who is not logged in."""

    def make(racer: Racer | None) -> APIClient:
        client = APIClient()
        if racer is not None:
            client.credentials(HTTP_AUTHORIZATION=f"Token {AuthToken.objects.create(user=racer)[1]}")
        return client

    return make
