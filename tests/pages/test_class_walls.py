"""Names of learners are their teacher's alone, and a stranger finds nothing private: every page asked by everybody."""

from __future__ import annotations

import re

import pytest
from django.test import Client
from django.urls import get_resolver

from accounts.models import ClassLearner, RacerGroup
from races.models import Race
from tests.factories import a_racer
from tests.pages.browsing import BACKEND
from tests.pages.walk import Site, make_site

pytestmark = [pytest.mark.soak, pytest.mark.django_db]
NAMES = ("Kim Minji", "Ann Lee")
OTHERS = ("anonymous", "bob", "newcomer", "admin")


@pytest.fixture
def site(wakes, video_wakes, trainings_taken_on) -> Site:
    return make_site()


def everywhere(site: Site) -> list[str]:
    """Every address that the walk of pages visits, and those of the API and the admin site that name nothing."""
    walked = {path for paths in site.paths.values() for path in paths if "logout" not in path}
    plain = {f"/{route}" for route in _plain(get_resolver().url_patterns) if route.startswith(("api/v1/", "admin/"))}
    return sorted(walked | {path for path in plain if "logout" not in path})


def _plain(patterns, prefix: str = ""):
    for one in patterns:
        path = prefix + str(one.pattern)
        if hasattr(one, "url_patterns"):
            yield from _plain(one.url_patterns, path)
        elif not re.search(r"[<^(\\]", path):
            yield path


def read(client: Client, path: str) -> str:
    answer = client.get(path)
    if answer.streaming:
        return ""
    return answer.content.decode(errors="replace")


def test_nobody_but_the_teacher_reads_the_names_of_learners(site):
    learner = ClassLearner.objects.select_related("racer").first()
    assert learner is not None
    as_learner = Client()
    as_learner.force_login(learner.racer, backend=BACKEND)
    clients = {viewer: site.world.client(viewer) for viewer in OTHERS} | {"learner": as_learner}
    paths = [*everywhere(site), f"/racers/{learner.racer.alias}/", f"/api/v1/following/{learner.racer.alias}/"]
    told = [
        (who, path) for path in paths for who, client in clients.items() if any(n in read(client, path) for n in NAMES)
    ]
    assert told == []
    teacher = site.world.client("alice")
    assert [path for path in paths if NAMES[0] in read(teacher, path)] == ["/classes/7c/"]


def test_a_stranger_finds_nothing_private(site):
    RacerGroup.objects.filter(name="Owls").update(is_listed=False)
    secret = Race.objects.get(slug="secret-race")
    pages = [
        *("/classes/7c/", "/groups/owls/", "/groups/7c/"),
        *(
            f"/races/secret-race/{each}"
            for each in ("", "rules/", "board.json", "board.csv", "board.atom", "badge.svg")
        ),
        *(
            f"/races/secret-race/{each}"
            for each in ("laps/", "laps.csv", "timing/", "timing/set-up/", "racers/", "edit/")
        ),
        *(f"/races/secret-race/{each}" for each in ("event/", "live/screen/", "results.pdf", "invited/")),
        *(f"/api/v1/races/secret-race/{each}" for each in ("", "board/", "sessions/", "timing/", "guests/", "live/")),
    ]
    stranger = Client()
    stranger.force_login(a_racer("stranger"), backend=BACKEND)
    for who, client in (("anonymous", Client()), ("stranger", stranger)):
        for path in pages:
            answer = client.get(path)
            assert answer.status_code in (302, 401, 403, 404), (who, path, answer.status_code)
            assert "login" in answer.headers.get("Location", "login") and secret.name not in read(client, path), path
        for path in (
            "/",
            "/races/",
            "/races/?show=closed",
            "/api/v1/races/",
            "/racers/alice/",
            "/groups/",
            "/classes/",
        ):
            assert not re.search(r"Secret race|Owls|7c", read(client, path)), (who, path)
