"""A platform that really runs, registered here, with a course that is linked with a class."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from django.core.cache import cache
from django.test import Client

from courses.models import LtiContext, LtiPlatform
from tests.courses.lti.launching import SITE, launched
from tests.courses.lti.platform import Platform, new_key, running_platform

KEY = new_key()


@pytest.fixture(scope="session")
def key_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site's key, which the first test that needs it makes."""
    return tmp_path_factory.mktemp("lti") / "lti-key.pem"


@pytest.fixture(autouse=True)
def _private(settings, key_file: Path) -> None:
    settings.LTI_PRIVATE = True  # the platform of the tests is on this machine
    settings.LTI_KEY_FILE = key_file
    cache.clear()


@pytest.fixture
def platform() -> Iterator[Platform]:
    with running_platform(key=KEY, redirects=[f"{SITE}/lti/launch/"]) as made:
        made.tool_keys = lambda: Client().get("/lti/keys.json").json()
        made.people = {
            "t-1": ("Grace Hopper", "Instructor"),
            "s-1": ("Ada Lovelace", "Learner"),
            "s-2": ("Alan Turing", "Learner"),
        }
        yield made


@pytest.fixture
def registered(db, platform: Platform) -> LtiPlatform:
    return LtiPlatform.objects.create(
        name="Example University",
        issuer=platform.base,
        client_id=platform.client_id,
        deployments=[platform.deployment],
        authorize_url=f"{platform.base}/authorize",
        token_url=f"{platform.base}/token",
        jwks_url=f"{platform.base}/jwks",
    )


@pytest.fixture
def course(registered: LtiPlatform, platform: Platform) -> LtiContext:
    """The course, which its teacher has opened for the first time."""
    launched(platform, "t-1", do=("new", "new-class"))
    return LtiContext.objects.get()
