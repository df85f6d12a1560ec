"""The public profile of a racer, from one list of fields for page, form and API."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client
from drf_spectacular.generators import SchemaGenerator
from rest_framework.test import APIClient

from accounts.models import Racer
from accounts.profile import fields
from accounts.profile.fields import ProfileField
from accounts.profile.services import change_profile
from evaluation.models import TrainedModel
from league.racers.selectors import profile_of
from races.models import Visibility
from tests.docs.pages import code_blocks, section, text
from tests.factories import a_model, a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db
AT = "/api/v1/racers/alice/"
# The field that the page of common changes shows, in a column that racers have already
(SHOWN,) = code_blocks(section(text("changes.md"), "## A profile field"), "python")
FIELD = SHOWN.replace("motto", "guest_name")


@pytest.fixture
def alice() -> Racer:
    return a_racer("alice", country="KR", team="Blue")


def as_racer(racer: Racer | None) -> APIClient:
    client = APIClient()
    if racer is not None:
        client.force_authenticate(racer)
    return client


def logged_in(racer: Racer | None) -> Client:
    client = Client()
    if racer is not None:
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client


class TestWhoSeesWhat:
    @pytest.fixture
    def cast(self, alice, now) -> dict[str, Racer | None]:
        for name, visibility in (("Open", Visibility.PUBLIC), ("Sealed", Visibility.INVITATION)):
            race = a_race(now, name=name, slug=name.lower(), visibility=visibility, organiser=alice)
            drive(race, alice, laps(10_000, 10_000, 10_000), race.opens_at)
        TrainedModel.objects.filter(pk=a_model(alice, name="Lent").pk).update(shared_at=now)
        staff = a_racer("staff", is_staff=True, is_superuser=True)
        return {"guest": None, "owner": alice, "stranger": a_racer("stranger"), "staff": staff}

    @pytest.mark.parametrize("viewer", ["guest", "owner", "stranger", "staff"])
    def test_the_api_shows_what_the_page_shows(self, viewer, cast):
        answer = as_racer(cast[viewer]).get(AT)
        assert answer.status_code == 200
        shown, page = answer.data, logged_in(cast[viewer]).get("/racers/alice/").content.decode()
        assert (shown["alias"], shown["country"], shown["team"], shown["is_house"]) == ("alice", "KR", "Blue", False)
        sees_all = viewer in ("owner", "staff")
        races = {"open", "sealed"} if sees_all else {"open"}
        assert {one["race"] for one in shown["races"]} == {one["race"] for one in shown["organises"]} == races
        assert shown["honours"]["races"] == len(races)
        assert ("Sealed" in page) is sees_all and "Open" in page and "South Korea" in page
        models = [one["name"] for one in shown["shared_models"]]
        assert models == ([] if viewer == "guest" else ["Lent"])
        assert ("Lent" in page) is bool(models)

    def test_a_race_has_place_score_and_run(self, cast):
        (raced,) = as_racer(None).get(AT).data["races"]
        run = raced.pop("run")
        assert raced == {"race": "open", "name": "Open", "rank": 1, "score_ms": 10_000, "best_lap_ms": 10_000}
        assert logged_in(None).get(f"/evaluations/{run}/").status_code == 200


@pytest.mark.parametrize("viewer", ["guest", "stranger"])
def test_a_closed_account_has_neither_page_nor_profile(viewer, alice):
    Racer.objects.filter(pk=alice.pk).update(is_active=False)
    someone = None if viewer == "guest" else a_racer("stranger")
    assert as_racer(someone).get(AT).status_code == logged_in(someone).get("/racers/alice/").status_code == 404


def test_an_alias_is_found_in_any_case(alice):
    assert as_racer(None).get("/api/v1/racers/ALICE/").data["alias"] == "alice"


class TestADummyField:
    @pytest.fixture(autouse=True)
    def motto(self):
        """A field in a column that profiles do not have otherwise."""
        exec(compile(FIELD, "changes.md", "exec"), {})
        yield
        del fields.FIELDS["guest_name"]

    def test_the_form_has_it_and_the_page_shows_it(self, alice):
        client = logged_in(alice)
        assert "Motto" in client.get("/settings/").content.decode()
        client.post("/settings/", {"country": "KR", "guest_name": "Flat out"})
        alice.refresh_from_db()
        assert (alice.guest_name, alice.country) == ("Flat out", "KR")
        assert "Motto: Flat out" in logged_in(None).get("/racers/alice/").content.decode()

    def test_the_api_writes_and_shows_it_and_the_schema_names_it(self, alice):
        answer = as_racer(alice).patch("/api/v1/me/", {"guest_name": "Late apex"}, format="json")
        assert (answer.status_code, answer.data["guest_name"], answer.data["country"]) == (200, "Late apex", "KR")
        assert as_racer(None).get(AT).data["guest_name"] == "Late apex"
        schemas = SchemaGenerator().get_schema(request=None, public=True)["components"]["schemas"]
        assert {"guest_name", "country", "followers"} <= set(schemas["Profile"]["properties"])


def test_a_field_needs_a_free_name_and_both_ways_to_edit():
    country = fields.FIELDS["country"]
    with pytest.raises(ValueError, match="another field"):
        fields.register(country)
    with pytest.raises(ValueError, match="lacks"):
        fields.register(ProfileField("x", country.value, country.text, country.api, country.form))


def test_only_fields_of_the_form_are_changed(alice, now):
    with pytest.raises(ValueError, match="country"):
        change_profile(racer=alice, values={"is_staff": True}, now=now)
    alice.refresh_from_db()
    assert not alice.is_staff and profile_of(alice, AnonymousUser(), now).fields["country"] == "KR"
