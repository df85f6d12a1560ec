"""Operations find what their address names before they read a body."""

from __future__ import annotations

import pytest
from django.utils import timezone

from config.api.urls import version_1
from races.models import Visibility
from tests.factories import a_race

WRITES = ("post", "put", "patch", "delete")
OPERATIONS = [
    (route, method)
    for entry in version_1
    for route in getattr(entry, "url_patterns", [entry])
    for method in WRITES
    if hasattr(route.callback.cls, method)
]


def test_every_write_with_parameters_in_its_address_finds_what_they_name():
    named = [(route, method) for route, method in OPERATIONS if "<" in str(route.pattern)]
    assert len(named) > 50
    assert [
        (route.name, method) for route, method in named if not hasattr(getattr(route.callback.cls, method), "lookup")
    ] == []


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("method", "path"),
    [
        *(("post", "close/"), ("post", "spectators/"), ("post", "invitation/"), ("post", "entry/")),
        *(("delete", "entry/"), ("delete", "sensors/1/"), ("delete", "timekeepers/bob/"), ("delete", "removals/bob/")),
        *(("patch", "live/"), ("post", "live/console/"), ("post", "live/mine/")),
        *(("post", "live/speed/"), ("patch", "live/speed/")),
    ],
)
@pytest.mark.parametrize("body", [{}, {"nonsense": 5}])
def test_a_stranger_does_not_learn_what_is_wrong_with_a_body(method, path, body, alice, charlie, as_racer):
    race = a_race(timezone.now(), organiser=alice, visibility=Visibility.INVITATION)
    answer = getattr(as_racer(charlie), method)(f"/api/v1/races/{race.slug}/{path}", body)
    assert (answer.status_code, answer.data["code"]) == (404, "not_found")
