"""A platform that really runs, registered here, with a course that is linked with a class."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from django.core.cache import cache
from django.test import Client
from django.test.utils import override_settings

from courses.models import LtiContext, LtiPlatform
from tests.courses.lti.launching import SITE, launched
from tests.courses.lti.platform import Platform, new_key, running_platform
from tests.kept import Kept


@pytest.fixture(scope="session")
def key_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site's key, which the first test that needs it makes."""
    return tmp_path_factory.mktemp("lti") / "lti-key.pem"


@pytest.fixture(autouse=True)
def _private(settings, key_file: Path) -> None:
    settings.LTI_PRIVATE = True  # the platform of the tests is on this machine
    settings.LTI_KEY_FILE = key_file
    cache.clear()


@pytest.fixture(scope="session")
def served() -> Iterator[Platform]:
    with running_platform(key=new_key()) as made:
        yield made


@pytest.fixture
def platform(served: Platform) -> Platform:
    return as_new(served)


def as_new(platform: Platform) -> Platform:
    """As if nobody had come from it yet; its address and key stay."""
    vars(platform).update(
        vars(
            Platform(
                base=platform.base,
                key=platform.key,
                redirects=[f"{SITE}/lti/launch/"],
                tool_keys=lambda: Client().get("/lti/keys.json").json(),
                people={
                    "t-1": ("Grace Hopper", "Instructor"),
                    "s-1": ("Ada Lovelace", "Learner"),
                    "s-2": ("Alan Turing", "Learner"),
                },
            )
        )
    )
    return platform


@pytest.fixture
def registered(db: None, platform: Platform) -> LtiPlatform:
    return LtiPlatform.objects.filter(issuer=platform.base).first() or register(platform)


def register(platform: Platform) -> LtiPlatform:
    return LtiPlatform.objects.create(
        name="Example University",
        issuer=platform.base,
        client_id=platform.client_id,
        deployments=[platform.deployment],
        authorize_url=f"{platform.base}/authorize",
        token_url=f"{platform.base}/token",
        jwks_url=f"{platform.base}/jwks",
    )


@pytest.fixture(scope="session")
def kept_course(request: pytest.FixtureRequest, keep: Callable, served: Platform, key_file: Path) -> Kept:
    return keep(request, lambda: opened(served, key_file), fresh_s=60.0)


def opened(platform: Platform, key_file: Path, then: Callable[[], object] = lambda: None) -> tuple:
    """Open the course and do what comes ``then``; what is in memory of it."""
    cache.clear()
    with override_settings(LTI_PRIVATE=True, LTI_KEY_FILE=key_file):
        register(as_new(platform))
        launched(platform, "t-1", do=("new", "new-class"))
        then()
    return platform.fetched, [dict(cache._cache), dict(cache._expire_info)]


def back_to(kept: Kept, platform: Platform) -> None:
    platform.fetched, (values, expiries) = kept.copy()
    cache._cache.update(values)
    cache._expire_info.update(expiries)


@pytest.fixture
def course(kept_course: Kept, registered: LtiPlatform, platform: Platform) -> LtiContext:
    """The course, which its teacher has opened for the first time."""
    back_to(kept_course, platform)
    return LtiContext.objects.get()
