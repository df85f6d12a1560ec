"""Requests at the same instant: one key acts once, and no condition lets a change be written over."""

from __future__ import annotations

from threading import Event

import pytest
from django.core.cache import cache
from django.db import connection
from rest_framework.test import APIClient

from accounts.models import Racer
from accounts.tokens.services import create_token
from core.api import views
from races.models import Race
from tests.factories import a_race, a_racer
from tests.races.test_concurrency import at_once
from training.models import Vehicle

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.slow]
VEHICLES = "/api/v1/vehicles/"
VAN = {"name": "Evo", "sensors": ["STEREO_CAMERAS"]}
KEY = {"Idempotency-Key": "one"}
IN_TIME_S = 10.0
MEANWHILE_S = 1.0  # on SQLite the others wait for the end of the transaction, so nobody waits for them


@pytest.fixture
def owner(db, now, wakes) -> Racer:
    cache.clear()
    return a_racer("alice")


@pytest.fixture
def client(owner, now) -> APIClient:
    return APIClient(headers={"Authorization": f"Bearer {create_token(racer=owner, now=now)[1]}"})


def is_postgresql() -> bool:
    return connection.vendor == "postgresql"


def test_of_many_requests_with_one_key_one_acts(client):
    answers = at_once([lambda: client.post(VEHICLES, VAN, headers=KEY)] * 6)
    assert Vehicle.objects.count() == 1
    created = [answer for answer in answers if answer.status_code == 201]
    assert {answer.content for answer in created} == {created[0].content}
    assert sum(not answer.has_header("Idempotent-Replayed") for answer in created) == 1
    refused = {(answer.status_code, answer.json()["code"]) for answer in answers if answer not in created}
    assert refused <= {(409, "idempotency_key_in_use")}
    assert client.post(VEHICLES, VAN, headers=KEY)["Idempotent-Replayed"] == "true"


def test_a_key_in_use_is_refused_or_waits_for_the_first_answer(client, monkeypatch):
    inside, answered = Event(), Event()
    keep = views.Repeat.keep

    def slowly(self, response, *, now):
        inside.set()
        answered.wait(IN_TIME_S if is_postgresql() else MEANWHILE_S)
        keep(self, response, now=now)

    monkeypatch.setattr(views.Repeat, "keep", slowly)

    def second():
        assert inside.wait(IN_TIME_S)
        answer = client.post(VEHICLES, VAN, headers=KEY)
        answered.set()
        return answer

    first, other = at_once([lambda: client.post(VEHICLES, VAN, headers=KEY), second])
    assert first.status_code == 201 and Vehicle.objects.count() == 1
    if is_postgresql():
        assert (other.status_code, other.json()["code"], other["Retry-After"]) == (409, "idempotency_key_in_use", "1")
    else:
        assert (other.status_code, other.content) == (201, first.content)


def test_of_many_changes_with_one_etag_one_is_written(client, owner, now):
    a_race(now, slug="night", organiser=owner)
    at = "/api/v1/races/night/"
    etag = client.get(at)["ETag"]
    names = [f"Name {number}" for number in range(6)]
    answers = at_once(
        [lambda name=name: client.patch(at, {"name": name}, headers={"If-Match": etag}) for name in names]
    )
    written = [name for name, answer in zip(names, answers, strict=True) if answer.status_code == 200]
    assert sorted(answer.status_code for answer in answers) == [200, *[412] * 5]
    assert [Race.objects.get().name] == written


def test_what_others_commit_after_the_check_is_not_written_over(client, owner, now, monkeypatch):
    """The other does not use conditions: a form of the site, or a worker."""
    race = a_race(now, slug="night", organiser=owner)
    at = "/api/v1/races/night/"
    etag = client.get(at)["ETag"]
    checked, changed = Event(), Event()
    check = views.APIView._condition_holds

    def then_wait(self):
        holds = check(self)
        checked.set()
        changed.wait(IN_TIME_S if is_postgresql() else MEANWHILE_S)
        return holds

    monkeypatch.setattr(views.APIView, "_condition_holds", then_wait)

    def other():
        assert checked.wait(IN_TIME_S)
        Race.objects.filter(pk=race.pk).update(name="By a form", prize="A cup")
        changed.set()

    mine, _ = at_once([lambda: client.patch(at, {"name": "Mine"}, headers={"If-Match": etag}), other])
    race.refresh_from_db()
    assert race.name == "By a form"
    assert mine.status_code == (412 if is_postgresql() else 200), "on SQLite the other came after mine"
    if is_postgresql():
        assert mine.json()["code"] == "precondition_failed"


def test_of_two_that_add_to_the_list_they_read_one_does(client, monkeypatch):
    etag = client.get(VEHICLES)["ETag"]
    vans = [VAN | {"name": f"Van {number}"} for number in range(4)]
    answers = at_once([lambda van=van: client.post(VEHICLES, van, headers={"If-Match": etag}) for van in vans])
    assert sorted(answer.status_code for answer in answers) == [201, 412, 412, 412]
    assert Vehicle.objects.count() == 1
