"""Guests of races of real cars over the API: whom the organiser hands their secret, and whose the laps become."""

from __future__ import annotations

import pytest
from django.utils import timezone

from accounts.models import Racer
from races.models import Entry, Guest
from tests.races.timing import a_timed_race

pytestmark = pytest.mark.django_db
RACE = "/api/v1/races/real-race/"


@pytest.fixture
def mia(alice, bob) -> Guest:
    """A guest of Alice's race, in which Bob takes times."""
    return a_timed_race(timezone.now(), alice, bob)[1]


def test_only_who_organises_reads_the_secrets_of_guests(cast, mia):
    for role in ("member", "stranger", "anonymous"):
        assert cast[role].get(f"{RACE}guests/").status_code in (401, 403), role
        assert mia.claim not in str(cast[role].get(f"{RACE}timing/").data)
    for role in ("owner", "admin"):
        (row,) = cast[role].get(f"{RACE}guests/").data
        assert (row["name"], row["racer"], row["claim"]) == ("Mia Guest", None, mia.claim)
        assert row["claim_url"] == f"http://testserver/laps/{mia.claim}/"


def test_a_guest_with_an_account_claims_their_laps(cast, mia, charlie):
    assert cast["anonymous"].post("/api/v1/timing/claims/", {"claim": mia.claim}).status_code == 401
    answer = cast["stranger"].post("/api/v1/timing/claims/", {"claim": mia.claim})
    assert answer.status_code == 200, answer.data
    assert (answer.data["racer"], answer.data["best_lap_ms"]) == ("charlie", 13_000)
    assert not Racer.objects.exclude(guest_name="").exists()
    again = cast["member"].post("/api/v1/timing/claims/", {"claim": mia.claim})
    assert (again.status_code, again.data["code"]) == (409, "guest_linked")
    assert cast["member"].post("/api/v1/timing/claims/", {"claim": "x"}).data["code"] == "guest_unknown"
    (row,) = cast["owner"].get(f"{RACE}guests/").data
    assert (row["racer"], row["claim"], row["claim_url"]) == ("charlie", None, None)


def test_the_organiser_links_a_guest(cast, mia, charlie):
    address = f"{RACE}guests/{mia.pk}/"
    for role in ("member", "stranger"):
        assert cast[role].post(address, {"racer": "charlie"}).status_code == 403
    assert cast["owner"].post(address, {"racer": "nobody-there"}).data["code"] == "timekeeper_unknown"
    assert cast["owner"].post(f"{RACE}guests/17/", {"racer": "charlie"}).status_code == 404
    assert Entry.objects.filter(guest_name="Mia Guest").exists()
    answer = cast["owner"].post(address, {"racer": "Charlie"})
    assert (answer.status_code, answer.data["racer"]) == (200, "charlie")
    assert not Entry.objects.exclude(guest_name="").exists()
